// A constant that C++17 has no name for.
#pragma once

namespace ball_sim::core {

constexpr double kPi = 3.14159265358979323846;

}  // namespace ball_sim::core
