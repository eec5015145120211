// ball_sim_rviz: RViz with a given configuration, its camera moved to where the balls are.
//
// Scenes differ in size by far more than one view can serve, and RViz takes a view only from its
// configuration. So this waits for the first markers, writes the configuration anew into the user's
// folder for ROS, and becomes RViz.
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <unistd.h>
#include <visualization_msgs/MarkerArray.h>
#include <yaml-cpp/yaml.h>

#include <chrono>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "camera.hpp"

namespace ball_sim {
namespace {

constexpr std::chrono::seconds kPatience(10);  // then without the markers
constexpr double kAspect = 1.38;               // of RViz's picture in the window as configured
constexpr double kMargin = 1.03;               // around the scene
constexpr double kLowPitch = 0.45;             // rad, for what is not flat

/// What is drawn, as soon as there are balls; nothing when none come.
std::optional<Bounds> awaitBounds() {
  ros::CallbackQueue queue;
  ros::NodeHandle node("ball_sim");
  node.setCallbackQueue(&queue);
  visualization_msgs::MarkerArray balls;
  visualization_msgs::MarkerArray surroundings;
  using Markers = visualization_msgs::MarkerArray;
  const auto keep = [](Markers& kept) {
    return boost::function<void(const Markers&)>([&kept](const Markers& m) { kept = m; });
  };
  const auto ball_subscriber = node.subscribe<Markers>("markers", 1, keep(balls));
  const auto scene_subscriber = node.subscribe<Markers>("scene_markers", 1, keep(surroundings));
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (ros::ok() && balls.markers.empty() && std::chrono::steady_clock::now() < deadline) {
    queue.callAvailable(ros::WallDuration(0.1));
  }
  Bounds bounds;
  bounds.include(balls);
  bounds.include(surroundings);
  return bounds.empty() ? std::nullopt : std::optional<Bounds>(bounds);
}

/// Points the current view of an RViz configuration at the bounds.
void aim(YAML::Node config, const Bounds& bounds) {
  YAML::Node view = config["Visualization Manager"]["Views"]["Current"];
  const core::Vector3 size = bounds.max() - bounds.min();
  const bool flat = size.z() < 0.3 * std::max(size.x(), size.y());
  const double pitch = flat ? view["Pitch"].as<double>() : kLowPitch;
  const Camera camera = cameraFor(bounds, view["Yaw"].as<double>(), pitch,
                                  view["Field of View"].as<double>(), kAspect);
  view["Pitch"] = pitch;
  view["Distance"] = kMargin * camera.distance;
  view["Near Clip Distance"] = 0.001 * camera.distance;
  view["Focal Point"]["X"] = camera.focus.x();
  view["Focal Point"]["Y"] = camera.focus.y();
  view["Focal Point"]["Z"] = camera.focus.z();
}

/// Where ROS keeps what is the user's: ROS_HOME, or ~/.ros.
std::filesystem::path rosHome() {
  if (const char* home = std::getenv("ROS_HOME")) {
    return home;
  }
  if (const char* home = std::getenv("HOME")) {
    return std::filesystem::path(home) / ".ros";
  }
  throw std::runtime_error("neither ROS_HOME nor HOME is set");
}

/// Writes over what was written before, so that no files pile up.
/// @return path of the file
std::string write(const YAML::Node& config) {
  const std::filesystem::path path = rosHome() / "ball_sim.rviz";
  std::filesystem::create_directories(path.parent_path());
  std::ofstream file(path);
  file << config << '\n';
  file.close();
  if (!file) {
    throw std::runtime_error("cannot write " + path.string());
  }
  return path.string();
}

/// @return path of the configuration to use
std::string prepare(const std::string& path) {
  const auto bounds = awaitBounds();
  if (!bounds) {
    return path;
  }
  const YAML::Node config = YAML::LoadFile(path);
  aim(config, *bounds);
  return write(config);
}

}  // namespace
}  // namespace ball_sim

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv, argv + argc);
  ros::init(argc, argv, "ball_sim_rviz", ros::init_options::AnonymousName);
  if (argc != 2) {
    ROS_FATAL("usage: ball_sim_rviz CONFIGURATION.rviz");
    return 2;
  }
  std::string config = argv[1];
  {
    const ros::NodeHandle keeps_log;
    try {
      config = ball_sim::prepare(config);
    } catch (const std::exception& error) {
      ROS_WARN_STREAM("RViz starts with its view unchanged: " << error.what());
    }
    if (!ros::ok()) {
      return 0;
    }
  }
  // RViz gets what roslaunch says, such as its name; only the configuration is replaced.
  std::vector<char*> rviz{const_cast<char*>("rviz"), const_cast<char*>("-d"), config.data()};
  for (std::size_t i = 2; i < arguments.size(); ++i) {
    rviz.push_back(const_cast<char*>(arguments[i].c_str()));
  }
  rviz.push_back(nullptr);
  execvp("rviz", rviz.data());
  perror("rviz");
  return 1;
}
