// ball_sim_replay: draws recorded balls. Turns ball_states and ball_properties, played from a bag,
// into the markers that the node would have sent; markers themselves are not worth recording.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstddef>
#include <string>
#include <vector>

#include "ball_markers.hpp"
#include "ball_sim/BallProperties.h"
#include "ball_sim/BallStates.h"
#include "conversions.hpp"

namespace ball_sim {
namespace {

class Replay {
 public:
  /// @param node      the namespace of the recorded node
  /// @param by_speed  colour by speed instead of as recorded
  Replay(ros::NodeHandle& node, bool by_speed) : ball_markers_(by_speed) {
    markers_ = node.advertise<visualization_msgs::MarkerArray>("markers", 1);
    properties_subscriber_ = node.subscribe("ball_properties", 10, &Replay::onProperties, this);
    states_subscriber_ = node.subscribe("ball_states", 10, &Replay::onStates, this);
  }

 private:
  void onProperties(const BallProperties& properties) {
    const std::size_t balls = properties.ids.size();
    if (properties.radii.size() != balls || properties.colors.size() != balls) {
      return;
    }
    properties_ = properties;
    drawn_ids_.clear();
    ball_markers_.setBalls({}, {});
  }

  void onStates(const BallStates& states) {
    const bool whole = states.positions.size() == states.ids.size() &&
                       states.velocities.size() == states.ids.size();
    if (!whole || markers_.getNumSubscribers() == 0) {
      return;
    }
    drawKnown(states);
    markers_.publish(ball_markers_.update(known_, states.header));
  }

  /// Keeps the balls whose properties are known: around a change the two topics may differ.
  void drawKnown(const BallStates& states) {
    fillStates(states, known_);
    std::vector<double> radii;
    std::vector<std_msgs::ColorRGBA> colors;
    std::size_t kept = 0;
    std::size_t j = 0;  // ids ascend in both
    for (std::size_t i = 0; i < known_.ids.size(); ++i) {
      while (j < properties_.ids.size() && properties_.ids[j] < known_.ids[i]) {
        ++j;
      }
      if (j == properties_.ids.size() || properties_.ids[j] != known_.ids[i]) {
        continue;
      }
      radii.push_back(properties_.radii[j]);
      colors.push_back(properties_.colors[j]);
      known_.ids[kept] = known_.ids[i];
      known_.positions[kept] = known_.positions[i];
      known_.velocities[kept] = known_.velocities[i];
      ++kept;
    }
    known_.ids.resize(kept);
    known_.positions.resize(kept);
    known_.velocities.resize(kept);
    if (known_.ids != drawn_ids_) {
      ball_markers_.setBalls(radii, colors);
      drawn_ids_ = known_.ids;
    }
  }

  BallProperties properties_;  // the last that came
  core::BallStates known_;
  std::vector<core::BallId> drawn_ids_;  // what ball_markers_ is set to
  BallMarkers ball_markers_;
  ros::Publisher markers_;
  ros::Subscriber properties_subscriber_;
  ros::Subscriber states_subscriber_;
};

}  // namespace
}  // namespace ball_sim

int main(int argc, char** argv) {
  ros::init(argc, argv, "ball_sim_replay");
  ros::NodeHandle node("ball_sim");
  const auto color_by = ros::NodeHandle("~").param<std::string>("color_by", "recorded");
  if (color_by != "recorded" && color_by != "speed") {
    ROS_FATAL_STREAM("parameter ~color_by: \"" << color_by << "\": must be recorded or speed");
    return 1;
  }
  ball_sim::Replay replay(node, color_by == "speed");
  ros::spin();
  return 0;
}
