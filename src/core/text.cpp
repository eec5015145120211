// Numbers as people write and read them.
#include "ball_sim/text.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <locale>
#include <sstream>

namespace ball_sim::core {

std::string formatNumber(double value) {
  char text[32];
  // 15 digits survive any decimal a person typed; 17 any double.
  for (int digits = 15; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::strtod(text, nullptr) == value) break;
  }
  return text;
}

std::string formatShort(double value) {
  const double size = std::abs(value);
  char text[32];
  std::snprintf(text, sizeof text, size >= 100 && size < 1e5 ? "%.0f" : "%.2g", value);
  return text;
}

std::string formatVector(const Vector3& vector) {
  return "(" + formatNumber(vector.x()) + ", " + formatNumber(vector.y()) + ", " +
         formatNumber(vector.z()) + ")";
}

std::string formatList(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::optional<double> parseDecimal(const std::string& text) {
  if (text.find_first_not_of("0123456789+-.eE") != std::string::npos) return std::nullopt;
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  double value = 0;
  stream >> value;
  if (stream.fail() || stream.peek() != std::istringstream::traits_type::eof()) {
    return std::nullopt;
  }
  return value;
}

}  // namespace ball_sim::core
