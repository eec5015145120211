# find_package(ball_sim_core): the target ball_sim::ball_sim_core, which needs no ROS.
include(CMakeFindDependencyMacro)
set(THREADS_PREFER_PTHREAD_FLAG ON)
find_dependency(Threads)
find_dependency(Eigen3 3.3 NO_MODULE)
find_dependency(yaml-cpp)
include(${CMAKE_CURRENT_LIST_DIR}/ball_sim_core-targets.cmake)
