// ball_sim_node: a simulation as a ROS node. See the package's README for topics and services.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>

#include <csignal>
#include <exception>

#include "ball_sim/scene_reader.hpp"
#include "ball_sim/world.hpp"
#include "outputs.hpp"
#include "parameters.hpp"
#include "scene_file.hpp"
#include "services.hpp"
#include "simulator.hpp"

namespace ball_sim {
namespace {

core::World makeWorld(const Parameters& parameters) {
  core::Scene scene = core::readScene(findScene(parameters.scene));
  if (parameters.seed) {
    auto seed = static_cast<std::uint64_t>(*parameters.seed);
    for (core::Fill& fill : scene.fill) {
      fill.seed = seed++;
    }
  }
  core::WorldOptions options;
  options.method = parameters.method;
  options.time_step = parameters.time_step;
  options.tolerance = parameters.tolerance;
  options.threads = static_cast<unsigned>(parameters.threads);
  options.max_balls = static_cast<std::size_t>(parameters.max_balls);
  return core::World(scene, options);
}

void run(ros::NodeHandle& node) {
  const Parameters parameters = readParameters(node);
  core::World world = makeWorld(parameters);
  ROS_INFO_STREAM("scene " << world.scene().name << ": " << world.size() << " balls, method "
                           << world.method().name << " (" << world.method().reason << ")");
  Outputs outputs(node, parameters);
  Simulator simulator(parameters, world, outputs, [] { return ros::isShuttingDown(); });
  const Services services(node, simulator, parameters.wall_timeout);
  simulator.run();
}

}  // namespace
}  // namespace ball_sim

int main(int argc, char** argv) {
  ros::init(argc, argv, "ball_sim");
  std::signal(SIGTERM, [](int) { ros::requestShutdown(); });
  ros::NodeHandle node("~");  // outlives the error: the last one to go takes the log with it
  try {
    ball_sim::run(node);
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM(error.what());
    return 1;
  }
  return 0;
}
