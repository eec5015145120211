// The box in which space may repeat, and the images of a place in it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core::continuous {

/// Whole periods along each axis, to an image.
using Turns = std::array<std::int16_t, 3>;

template <class Real>
class PeriodicBox {
  using Vec = VectorOf<Real>;

 public:
  explicit PeriodicBox(const Surroundings& surroundings)
      : repeats_(surroundings.periodic), low_(surroundings.box.min.cast<Real>()) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!repeats_ || (axis == 2 && surroundings.planar())) continue;
      period_[axis] = Real(surroundings.box.max[axis]) - Real(surroundings.box.min[axis]);
    }
  }

  /// Whether space repeats along any axis.
  bool repeats() const { return repeats_; }

  /// m; 0: space does not repeat along that axis.
  Real period(std::size_t axis) const { return period_[static_cast<int>(axis)]; }

  /// The image of x that lies in the box.
  Vec wrapped(Vec x) const {
    using std::floor;
    if (!repeats_) return x;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(period_[axis] > 0)) continue;
      const Real low = low_[axis];
      const Real turns = floor((x[axis] - low) / period_[axis]);
      if (turns != 0) x[axis] -= turns * period_[axis];
      if (x[axis] < low) x[axis] += period_[axis];  // a rounding error out
      if (x[axis] >= low + period_[axis]) x[axis] = low;
    }
    return x;
  }

  /// From a place to the nearest image of another.
  /// @param dx  to any of its images, m
  Vec nearestImage(Vec dx) const {
    using std::floor;
    for (int axis = 0; axis < 3; ++axis) {
      if (period_[axis] > 0) {
        dx[axis] -= floor(dx[axis] / period_[axis] + Real(0.5)) * period_[axis];
      }
    }
    return dx;
  }

  /// How far that nearest image lies from the one that dx leads to.
  Turns turnsToNearest(const Vec& dx) const {
    using std::floor;
    Turns turns = {0, 0, 0};
    for (int axis = 0; axis < 3; ++axis) {
      if (!(period_[axis] > 0)) continue;
      turns[static_cast<std::size_t>(axis)] =
          static_cast<std::int16_t>(-floor(dx[axis] / period_[axis] + Real(0.5)));
    }
    return turns;
  }

  /// The same in m.
  Vec shiftOf(const Turns& turns) const {
    return {Real(turns[0]) * period_[0], Real(turns[1]) * period_[1], Real(turns[2]) * period_[2]};
  }

 private:
  bool repeats_;
  Vec low_;                   // m
  Vec period_ = Vec::Zero();  // m
};

}  // namespace ball_sim::core::continuous
