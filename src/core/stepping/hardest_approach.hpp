// How hard the impacts of a scene can be at first: what steps and springs have to be made for.
#pragma once

#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// How fast two balls meet at most, m/s: two of the fastest head-on, after the farthest fall there
/// is. 0: no ball moves and none falls.
/// Limits: at first; impacts of unlike balls speed some of them up. In an open scene balls fall as
/// far as they are spread.
double hardestApproach(const std::vector<Ball>& balls, const Surroundings& surroundings);

/// Of the balls that can move, m; +infinity: there is none.
double smallestRadius(const std::vector<Ball>& balls);

}  // namespace ball_sim::core
