// An endless row of evenly spaced instants, in whole nanoseconds.
#pragma once

#include <cstdint>

namespace ball_sim {

/// Instants k / rate for k = 0, 1, 2, ..., each rounded to the nearest nanosecond by itself, so
/// that no rounding adds up: at 60 Hz every 60th instant is a whole second.
class Grid {
 public:
  /// @param rate  Hz, 1e-3..1e6
  explicit Grid(double rate);

  /// Instant number `index`, ns. @param index  >= 0
  std::int64_t at(std::int64_t index) const;

  /// The first instant after `nanoseconds`, ns. @param nanoseconds  >= 0
  std::int64_t after(std::int64_t nanoseconds) const;

  /// The `count`-th instant after `nanoseconds`, ns. @param count  >= 1
  std::int64_t after(std::int64_t nanoseconds, std::int64_t count) const;

 private:
  std::int64_t indexAfter(std::int64_t nanoseconds) const;

  long double period_;  // ns
};

}  // namespace ball_sim
