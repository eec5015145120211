// A ball in the arrays of the stepping methods.
#pragma once

#include <cstdint>
#include <vector>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// What a step needs of a ball, in one cache line.
struct alignas(64) SteppedBall {
  Vector3 x = Vector3::Zero();  ///< centre, m, at the last step
  Vector3 v = Vector3::Zero();  ///< m/s, at the last step
  double radius = 0;            ///< m
  double w = 0;                 ///< reciprocal mass, 1/kg; 0: fixed
};

/// Index of a ball in a method's arrays; other methods name it so too.
using Slot = std::uint32_t;

/// Partners of a ball from here on are walls: kFirstWall + index into wallsOf().
constexpr std::uint32_t kFirstWall = 0xF8000000;

}  // namespace ball_sim::core
