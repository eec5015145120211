// Tells which balls lie still.
//
// A ball lies still when it stays within a thousandth of its radius r for a time in which it would
// fall by 8 r, 4 sqrt(r/g): then less than 1/8000 of gravity is left on it. A speed would not do:
// at the top of its flight, or before it tips over, a ball is slow too.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "stepping/stepped_ball.hpp"

namespace ball_sim::core {

class RestWatch {
 public:
  /// Steps from one look to the next.
  static constexpr std::uint32_t kLookEvery = 8;

  /// @param gravity    m/s^2, > 0
  /// @param time_step  s
  RestWatch(double gravity, double time_step)
      : gravity_(gravity), between_looks_(kLookEvery * time_step) {}

  void resize(std::size_t slots) { watched_.resize(slots); }

  /// Begins to watch a ball anew.
  void restart(Slot slot) { watched_[slot].looks = 0; }

  /// Looks at a ball, every kLookEvery steps. Returns whether it lies still.
  bool look(Slot slot, const SteppedBall& ball) {
    Watched& watched = watched_[slot];
    const Vector3 way = ball.x - watched.place;
    const double near = kStillWay * ball.radius;
    if (watched.looks == 0 || dot(way, way) > near * near) {
      watched = {ball.x, 1};
      return false;
    }
    const double time = between_looks_ * watched.looks++;
    return watched.looks > kFewestLooks && time >= kStillTime * std::sqrt(ball.radius / gravity_);
  }

  std::size_t bytes() const { return watched_.capacity() * sizeof(Watched); }

 private:
  static constexpr double kStillWay = 1e-3;         // of the radius
  static constexpr double kStillTime = 4;           // sqrt(r/g)
  static constexpr std::uint32_t kFewestLooks = 4;  // even where steps are as long as that

  struct Watched {
    Vector3 place = Vector3::Zero();  // m
    std::uint32_t looks = 0;          // since it is about there; 0: not yet looked at
  };

  double gravity_;        // m/s^2
  double between_looks_;  // s
  std::vector<Watched> watched_;
};

}  // namespace ball_sim::core
