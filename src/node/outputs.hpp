// Everything the node publishes.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <cstdint>
#include <string>

#include "ball_markers.hpp"
#include "ball_sim/BallProperties.h"
#include "ball_sim/BallStates.h"
#include "ball_sim/Collisions.h"
#include "ball_sim/SimStats.h"
#include "ball_sim/method.hpp"
#include "ball_sim/world.hpp"
#include "coloring.hpp"
#include "parameters.hpp"

namespace ball_sim {

/// The node's topics. Nothing is read from the world, filled or serialised for a topic without
/// subscribers, but for the latched ones, which are small or change seldom.
///
/// Stamps are ROS time. For the world's thread only.
class Outputs {
 public:
  /// Impacts listed in one ~collisions at most; the rest is counted.
  static constexpr std::size_t kMaxCollisions = 10000;

  Outputs(ros::NodeHandle& private_node, const Parameters& parameters);

  void publishClock(ros::Time stamp);

  /// ~ball_states.
  void publishStates(const core::World& world, ros::Time stamp);

  /// ~markers.
  void publishMarkers(const core::World& world, ros::Time stamp);

  /// ~ball_properties, when the set of balls has changed.
  void publishProperties(const core::World& world, ros::Time stamp);

  /// ~scene_markers, at the start.
  void publishSceneMarkers(const core::World& world);

  /// ~ball_properties and ~scene_markers once more, as they were.
  void repeatLatched();

  void publishStats(const SimStats& stats) { stats_.publish(stats); }

  /// Full name of ~markers.
  std::string markersTopic() const { return markers_.getTopic(); }

  bool wantsCollisions() const { return collisions_.getNumSubscribers() > 0; }

  /// ~collisions, unless nothing has happened. Empties the log.
  /// @param start  ROS time of simulated time 0, ns
  /// @return how many impacts were left out
  std::uint64_t publishCollisions(core::CollisionLog& log, std::int64_t start, ros::Time stamp);

 private:
  std_msgs::Header header(ros::Time stamp) const;

  const std::string frame_id_;
  const ColorBy color_by_;
  ros::Publisher clock_;  // not advertised with publish_clock false
  ros::Publisher states_;
  ros::Publisher properties_;
  ros::Publisher markers_;
  ros::Publisher scene_markers_;
  ros::Publisher collisions_;
  ros::Publisher stats_;

  // Kept for their memory.
  core::BallStates read_;
  BallStates states_message_;
  BallProperties properties_message_;
  visualization_msgs::MarkerArray scene_message_;
  BallMarkers ball_markers_;
};

}  // namespace ball_sim
