// What can be said of a state from outside, whoever made it.
#pragma once

#include <string>
#include <vector>

#include "ball_sim/ball.hpp"
#include "scene_plan.hpp"
#include "trajectory.hpp"

namespace ball_sim::core::chart {

/// The deepest overlap of two balls, or of a ball and a wall, m; 0: none.
double deepestOverlap(const PreparedScene& scene, const BallStates& states);

/// Largest distance of a ball from its true place, m.
/// @param date  s, of the states on the truth's clock
double largestError(const PreparedScene& scene, const Trajectory& truth, double date,
                    const BallStates& states);

/// Kinetic energy and that of gravity, J.
double energyOf(const PreparedScene& scene, const BallStates& states);

/// The truth as states. @param date  s
BallStates statesAt(const Trajectory& truth, double date);

/// Why a state is beyond use: not finite, a ball outside the walls, energy more than doubled.
/// @param true_energy  J
/// @return empty: usable
std::string defect(const PreparedScene& scene, const BallStates& states, double true_energy);

/// Whether momentum has to be conserved: no walls, no gravity.
bool conservesMomentum(const PreparedScene& scene);

/// Masses in the order of ids, kg.
std::vector<double> massesOf(const PreparedScene& scene);

}  // namespace ball_sim::core::chart
