// Numbers as people read them in messages.
#include "ball_sim/text.hpp"

#include <cstdio>
#include <cstdlib>

namespace ball_sim {

std::string formatNumber(double value) {
  char text[32];
  // 15 digits survive any decimal a person typed; 17 any double.
  for (int digits = 15; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::strtod(text, nullptr) == value) break;
  }
  return text;
}

std::string formatVector(const Vector3& vector) {
  return "(" + formatNumber(vector.x()) + ", " + formatNumber(vector.y()) + ", " +
         formatNumber(vector.z()) + ")";
}

}  // namespace ball_sim
