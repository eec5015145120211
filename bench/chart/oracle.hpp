// The motion of many balls in 256-bit arithmetic, by code that shares nothing with the methods but
// the definition of a ball: what they are judged by.
//
// Between impacts a ball flies along a line, which is kept as its place at date 0 and its velocity:
// with 77 digits there are enough for that. Who may meet whom is looked up anew after each slice
// of time, so short that no two balls from further apart can touch in it; impacts of those pairs,
// and of balls with walls, wait in a heap, and each is the plain root of the quadratic equation.
// So an impact takes some dozens of pairs, not all of them: 10^4 balls take seconds.
//
// Assumes: no gravity, a restitution of 1, no planes beside the faces of the box, no fixed balls,
// and in a periodic box edges of more than three times the largest reach.
#pragma once

#include "scene_plan.hpp"
#include "trajectory.hpp"

namespace ball_sim::core::chart {

/// @param until  s, from date 0
/// @throws std::invalid_argument  what it assumes does not hold of the scene
Trajectory oracleTrajectory(const PreparedScene& scene, double until);

}  // namespace ball_sim::core::chart
