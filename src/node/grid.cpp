#include "grid.hpp"

#include <cassert>
#include <cmath>

namespace ball_sim {

Grid::Grid(double rate) : period_(1e9L / static_cast<long double>(rate)) {
  assert(rate >= 1e-3 && rate <= 1e6);
}

std::int64_t Grid::at(std::int64_t index) const {
  return std::llround(static_cast<long double>(index) * period_);
}

std::int64_t Grid::after(std::int64_t nanoseconds) const { return after(nanoseconds, 1); }

std::int64_t Grid::after(std::int64_t nanoseconds, std::int64_t count) const {
  return at(indexAfter(nanoseconds) + count - 1);
}

std::int64_t Grid::indexAfter(std::int64_t nanoseconds) const {
  // The quotient may be off by one instant either way, as instants are rounded.
  auto index =
      static_cast<std::int64_t>(std::floor(static_cast<long double>(nanoseconds) / period_));
  while (at(index) <= nanoseconds) {
    ++index;
  }
  return index;
}

}  // namespace ball_sim
