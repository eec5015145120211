// Numbers as people read them in messages.
#pragma once

#include <string>

#include "ball_sim/vector.hpp"

namespace ball_sim {

/// The shortest decimal text that reads back as the same double: "0.05", "-inf", "nan".
std::string formatNumber(double value);

/// "(x, y, z)".
std::string formatVector(const Vector3& vector);

}  // namespace ball_sim
