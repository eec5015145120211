// Balls as RViz draws them: one SPHERE_LIST for each radius.
#pragma once

#include <std_msgs/ColorRGBA.h>
#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstddef>
#include <vector>

#include "ball_sim/ball.hpp"

namespace ball_sim {

/// Builds ~markers. A SPHERE_LIST has one size for all its spheres, so balls are sorted into radius
/// classes. Markers of classes that have become empty say DELETE, in every message: a message may
/// be lost, and a leftover would stay for ever.
///
/// Limits: beyond 100 different radii, radii are drawn rounded in even steps of the logarithm; with
/// radii from 1 to 10 that is off by at most 1.2 %.
class BallMarkers {
 public:
  /// @param by_speed  colour by speed instead of what setBalls() says
  explicit BallMarkers(bool by_speed) : by_speed_(by_speed) {}

  /// Says which balls there are.
  /// @param radii   m, > 0, one a ball in the order of their ids
  /// @param colors  the same
  void setBalls(const std::vector<double>& radii, const std::vector<std_msgs::ColorRGBA>& colors);

  /// Puts the balls in their places. The array stays valid until the next call.
  /// @param states  of the balls last set, in the same order
  const visualization_msgs::MarkerArray& update(const core::BallStates& states,
                                                const std_msgs::Header& header);

 private:
  visualization_msgs::Marker& markerOf(std::size_t ball) { return array_.markers[class_of_[ball]]; }
  void setColors(const std::vector<std_msgs::ColorRGBA>& colors);

  const bool by_speed_;
  visualization_msgs::MarkerArray array_;      // a marker per class, then the emptied ones
  std::vector<std::size_t> class_of_;          // per ball: index into array_
  std::vector<std::size_t> place_of_;          // per ball: index within its marker
  std::vector<std_msgs::ColorRGBA> changing_;  // by speed, reused
};

}  // namespace ball_sim
