// Arrays in another order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace ball_sim::core {

/// Moves what is at i to to[i], for `count` indices, cycle by cycle, in place.
/// @param to        a permutation of the indices
/// @param moved     scratch
/// @param exchange  exchange(i, j): what is at i and at j change places, in all arrays to be moved
template <class Indices, class Exchange>
void exchangeToPlaces(std::size_t count, const Indices& to, std::vector<bool>& moved,
                      Exchange exchange) {
  moved.assign(count, false);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (moved[i]) continue;
    // What has been pushed from its place waits at i for the next one.
    for (std::uint32_t at = to[i]; at != i; at = to[at]) {
      exchange(i, at);
      moved[at] = true;
    }
  }
}

/// The same for the values of one array.
template <class Values, class Indices>
void moveToPlaces(Values& values, const Indices& to, std::vector<bool>& moved) {
  exchangeToPlaces(values.size(), to, moved, [&values](std::uint32_t i, std::uint32_t j) {
    std::swap(values[i], values[j]);
  });
}

}  // namespace ball_sim::core
