// What a ball is, and what a set of moving balls looks like at one instant.
#pragma once

#include <cstdint>
#include <vector>

#include "ball_sim/time.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// Names a ball for the whole run: counted from 0 in the order of arrival, never used twice.
using BallId = std::uint32_t;

/// A smooth hard ball. Mass +infinity: a fixed ball, which nothing moves (its velocity is zero).
struct Ball {
  Vector3 position = Vector3::Zero();  ///< centre, m
  Vector3 velocity = Vector3::Zero();  ///< m/s
  double radius = 0;                   ///< m, > 0
  double mass = 0;                     ///< kg, > 0, or +infinity
};

/// All balls at one instant, one entry a ball in each vector, ids ascending.
struct BallStates {
  Time time;
  std::vector<BallId> ids;
  std::vector<Vector3> positions;   ///< m
  std::vector<Vector3> velocities;  ///< m/s
};

}  // namespace ball_sim::core
