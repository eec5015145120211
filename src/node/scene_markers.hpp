// What stands around the balls, as RViz draws it.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim {

/// A table under a planar scene, with cushions along closed faces; a floor and the edges of a box
/// in space; a slab for each plane. Floors are opaque, so that one can point at them.
///
/// What is endless is drawn as far as balls and closed faces reach. Stamps are 0: valid whenever.
/// @param balls  at the start, for the extent and the height of the table
/// @param radii  m, in the order of `balls`
visualization_msgs::MarkerArray sceneMarkers(const core::Surroundings& surroundings,
                                             const core::BallStates& balls,
                                             const std::vector<double>& radii,
                                             const std::string& frame_id);

}  // namespace ball_sim
