// The door to method event_driven, so that its templates are compiled in one place.
#pragma once

#include <memory>

#include "ball_sim/methods.hpp"

namespace ball_sim::core {

/// @param surroundings  checked; without gravity nothing of gravity is computed
std::unique_ptr<Method> makeEventDriven(const Surroundings& surroundings,
                                        const MethodSettings& settings);

}  // namespace ball_sim::core
