// Where centres of balls may lie: the box less a radius at each wall.
#pragma once

#include <cstddef>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/overlap_index.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

inline int axesOf(const Surroundings& surroundings) { return surroundings.planar() ? 2 : 3; }

/// Where centres of balls of `radius` may lie, as far as the box goes; min > max: nowhere.
Box centresWithin(const Surroundings& surroundings, double radius);

/// Indices of the balls, largest first.
std::vector<std::size_t> bySize(const std::vector<Ball>& balls);

/// All of `balls`, numbered from `first`.
OverlapIndex indexOf(const std::vector<Ball>& balls, const Surroundings& surroundings,
                     std::size_t first = 0);

}  // namespace ball_sim::core
