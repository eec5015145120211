// The door to method continuous, so that its templates are compiled in one place.
#pragma once

#include <memory>

#include "ball_sim/methods.hpp"

namespace ball_sim::core {

/// @param surroundings  checked; without gravity nothing of gravity is computed
/// @param threads       >= 1
std::unique_ptr<Method> makeContinuous(const Surroundings& surroundings, Precision precision,
                                       unsigned threads);

}  // namespace ball_sim::core
