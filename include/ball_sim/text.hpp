// Numbers and lists as people write and read them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// The shortest decimal text that reads back as the same double: "0.05", "-inf", "nan".
std::string formatNumber(double value);

/// About two digits, for sentences: "0.31", "120", "5.3e+06".
std::string formatShort(double value);

/// "(x, y, z)".
std::string formatVector(const Vector3& vector);

/// "a, b, c".
std::string formatList(const std::vector<std::string>& names);

/// A decimal number as YAML and C write it, in the C locale whatever the program's is; nothing for
/// any other text, infinities and NaN included, and for numbers too large for a double.
std::optional<double> parseDecimal(const std::string& text);

}  // namespace ball_sim::core
