// Places equal balls on a crystal with random vacancies: the way to dense fills.
#pragma once

#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/random_source.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// Puts equal balls on random sites of the close-packed lattice with the widest spacing that has
/// enough of them, stretched to fill the box, and shifts each at random within its gap.
///
/// Hexagonal layers (in a planar scene: rows), in each orientation along the axes. The box must
/// take whole rows and layers, which costs a small box more: in a cube, 1000 balls get to about
/// 0.54, 10^4 to 0.68, 10^6 to 0.72.
/// @param balls  all of one radius
/// @return false when no such lattice has enough sites; then `balls` are as before
bool placeOnLattice(std::vector<Ball>& balls, const Surroundings& surroundings,
                    const std::vector<Ball>& present, RandomSource& random);

}  // namespace ball_sim::core
