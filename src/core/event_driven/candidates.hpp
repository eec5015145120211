// The balls found near a ball, for PairSearch to look at.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

/// The balls found near a ball.
struct Candidates {
  std::vector<Slot> slots = std::vector<Slot>(256);  // more than are ever around one of equals
  std::size_t count = 0;

  /// Makes room for `more` beyond `count`.
  void reserve(std::size_t more) {
    if (slots.size() < count + more) slots.resize(2 * (count + more));
  }

  void add(Slot slot) {
    reserve(1);
    slots[count++] = slot;
  }

  /// Ends the list as PairSearch wants it: what follows are slots that there are.
  void close() {
    reserve(kSearchStep);
    std::fill_n(slots.begin() + static_cast<std::ptrdiff_t>(count), kSearchStep, Slot{0});
  }
};

}  // namespace ball_sim::core
