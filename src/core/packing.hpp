// Finds places for balls that overlap nothing.
#pragma once

#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/random_source.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// Gives each of `balls` a random place inside `surroundings`, where it overlaps neither another
/// nor one of `present`.
/// @param surroundings  a finite box
/// @throws PackingError  telling how far it came
void placeBalls(std::vector<Ball>& balls, const Surroundings& surroundings,
                const std::vector<Ball>& present, RandomSource& random);

}  // namespace ball_sim::core
