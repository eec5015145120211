// What a user should be told of a run that goes on well.
#pragma once

#include <string>

#include "ball_sim/world.hpp"

namespace ball_sim::core {

/// That impacts at one instant were taken in a way that the scene's simultaneous_impacts decides.
/// @return a sentence without a full stop; empty: nothing to tell
std::string policyWarning(const World& world);

}  // namespace ball_sim::core
