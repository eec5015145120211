// How long the frames of method continuous are best, by what work they make.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>

namespace ball_sim::core {

/// What the choice depends on.
struct FrameSurvey {
  std::size_t count = 0;
  double radii = 0;    ///< m, sum
  double speeds = 0;   ///< m/s, sum
  double fastest = 0;  ///< m/s
  double volume = 0;   ///< m^3 (planar: m^2), where the balls are
  bool planar = false;
  std::optional<double> search_rate;  ///< 1/s, after impacts; unknown: as in a thin gas

  void add(double radius, double speed) {
    ++count;
    radii += radius;
    speeds += speed;
    fastest = std::max(fastest, speed);
  }

  /// Room that a single ball would be given along an axis, m.
  double leastExtent() const { return radii > 0 ? 4 * radii / static_cast<double>(count) : 1; }
};

/// The length of frame with the least work per simulated time, s; +infinity: nothing moves.
///
/// A long frame is begun seldom, but all balls may go far in it, so that each has to look far; and
/// so it has to again after each of its impacts, whatever the frame. Costs are measured.
double frameLength(const FrameSurvey& survey);

}  // namespace ball_sim::core
