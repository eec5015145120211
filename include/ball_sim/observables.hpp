// Numbers that describe a state: energy, momentum, hash. Sums are compensated (Neumaier 1974), so
// that a drift that shows is the method's and not the sum's.
#pragma once

#include <cstdint>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// Sum of m v^2 / 2 over balls of finite mass, J.
/// @param masses  kg, one a ball, in the order of `states`
double kineticEnergy(const BallStates& states, const std::vector<double>& masses);

/// Sum of -m g.x over balls of finite mass, J; zero is at the origin.
double potentialEnergy(const BallStates& states, const std::vector<double>& masses,
                       const Vector3& gravity);

/// Sum of m v over balls of finite mass, kg m/s.
Vector3 momentum(const BallStates& states, const std::vector<double>& masses);

/// FNV-1a over the bits of ids, places and velocities: equal states, equal hash.
std::uint64_t stateHash(const BallStates& states);

}  // namespace ball_sim::core
