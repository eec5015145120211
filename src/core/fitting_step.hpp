// The time step that fits a scene which names none.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// A millisecond, or shorter where the scene asks for it:
/// - discrete: in it no ball moves by more than a quarter of the smallest radius at first, and
///   where balls may come to rest it is at most kGoodRestingStep;
/// - auto, which steps among balls that rest: at most kGoodRestingStep;
/// - soft_sphere: a fiftieth of the contact time at which the hardest impact at first overlaps by
///   `tolerance` of the smallest radius, or without one by a tenth of it.
/// @param method  a known name
/// @return s, > 0; for exact methods, which have no steps, a millisecond
double fittingTimeStep(const std::string& method, const std::vector<Ball>& balls,
                       const Surroundings& surroundings, std::optional<double> tolerance);

}  // namespace ball_sim::core
