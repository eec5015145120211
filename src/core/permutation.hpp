// Arrays in another order.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace ball_sim::core {

/// Moves each value to another index of the same array, cycle by cycle: what is at i goes to to[i].
/// @param to     a permutation of the indices
/// @param moved  scratch
template <class Values, class Indices>
void moveToPlaces(Values& values, const Indices& to, std::vector<bool>& moved) {
  moved.assign(values.size(), false);
  for (std::uint32_t i = 0; i < values.size(); ++i) {
    if (moved[i]) continue;
    auto carried = values[i];
    std::uint32_t at = i;
    do {
      at = to[at];
      std::swap(carried, values[at]);
      moved[at] = true;
    } while (at != i);
  }
}

}  // namespace ball_sim::core
