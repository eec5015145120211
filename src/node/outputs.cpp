#include "outputs.hpp"

#include <rosgraph_msgs/Clock.h>

#include "conversions.hpp"
#include "scene_markers.hpp"

namespace ball_sim {

Outputs::Outputs(ros::NodeHandle& private_node, const Parameters& parameters)
    : frame_id_(parameters.frame_id),
      color_by_(parameters.color_by),
      ball_markers_(color_by_ == ColorBy::speed) {
  // Queues: recorders may fall behind by two seconds; who shows balls wants the latest only.
  constexpr std::uint32_t kRecorded = 100;
  constexpr std::uint32_t kShown = 1;
  constexpr bool kLatched = true;
  if (parameters.publish_clock) {
    clock_ = private_node.advertise<rosgraph_msgs::Clock>("/clock", kRecorded);
  }
  states_ = private_node.advertise<BallStates>("ball_states", kRecorded);
  properties_ = private_node.advertise<BallProperties>("ball_properties", kRecorded, kLatched);
  markers_ = private_node.advertise<visualization_msgs::MarkerArray>("markers", kShown);
  scene_markers_ =
      private_node.advertise<visualization_msgs::MarkerArray>("scene_markers", kShown, kLatched);
  collisions_ = private_node.advertise<Collisions>("collisions", kRecorded);
  stats_ = private_node.advertise<SimStats>("stats", kRecorded, kLatched);
}

void Outputs::publishClock(ros::Time stamp) {
  if (clock_) {
    rosgraph_msgs::Clock message;
    message.clock = stamp;
    clock_.publish(message);
  }
}

void Outputs::publishStates(const core::World& world, ros::Time stamp) {
  if (states_.getNumSubscribers() == 0) {
    return;
  }
  world.read(read_);
  fillMessage(read_, states_message_);
  states_message_.header = header(stamp);
  states_.publish(states_message_);
}

void Outputs::publishMarkers(const core::World& world, ros::Time stamp) {
  if (markers_.getNumSubscribers() == 0) {
    return;
  }
  world.read(read_);
  markers_.publish(ball_markers_.update(read_, header(stamp)));
}

void Outputs::publishProperties(const core::World& world, ros::Time stamp) {
  properties_message_.header = header(stamp);
  properties_message_.ids = world.ids();
  properties_message_.radii = world.radii();
  properties_message_.masses = world.masses();
  properties_message_.restitution = world.surroundings().restitution;
  properties_message_.colors = lastingColors(color_by_, world.ids(), world.radii(), world.masses());
  ball_markers_.setBalls(world.radii(), properties_message_.colors);
  properties_.publish(properties_message_);
}

void Outputs::publishSceneMarkers(const core::World& world) {
  world.read(read_);
  scene_message_ = sceneMarkers(world.surroundings(), read_, world.radii(), frame_id_);
  scene_markers_.publish(scene_message_);
}

void Outputs::repeatLatched() {
  if (properties_.getNumSubscribers() > 0) {
    properties_.publish(properties_message_);
  }
  if (scene_markers_.getNumSubscribers() > 0) {
    scene_markers_.publish(scene_message_);
  }
}

std::uint64_t Outputs::publishCollisions(core::CollisionLog& log, std::int64_t start,
                                         ros::Time stamp) {
  const std::uint64_t dropped = log.dropped;
  if (!log.entries.empty() || dropped > 0) {
    Collisions message;
    message.header = header(stamp);
    message.dropped = static_cast<std::uint32_t>(dropped);
    message.collisions.reserve(log.entries.size());
    for (const core::Collision& collision : log.entries) {
      message.collisions.push_back(toMessage(collision, start));
    }
    collisions_.publish(message);
  }
  log.entries.clear();
  log.dropped = 0;
  return dropped;
}

std_msgs::Header Outputs::header(ros::Time stamp) const {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = frame_id_;
  return header;
}

}  // namespace ball_sim
