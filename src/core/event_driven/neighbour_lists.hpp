// Neighbour lists: who can touch whom before either has moved much.
//
// In a dense fluid a ball rattles among the same dozen others for many impacts. Each ball then has
// a home, a point of a fine lattice, and a region around it, a cube; its list names the balls that
// can touch it while both are inside their regions. When a ball leaves its region it gets a new
// home and a new list, and only then the cells are looked through. (Verlet's lists, 1967, renewed
// ball by ball, as in Donev, Torquato, Stillinger, "Neighbor list collision-driven molecular
// dynamics simulation for nonspherical hard particles", 2005.)
//
// The relation is mutual, and kept so: j is in the list of i as long as i is in that of j.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "event_driven/cell_grid.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

class NeighbourLists {
 public:
  /// Half the edge of a region, of the largest radius: wider regions are left less often, but have
  /// longer lists.
  static constexpr double kHalfRegion = 0.4;

  /// Homes lie on a lattice this many halvings finer than the cells.
  static constexpr int kLatticeDepth = 5;

  /// Forgets all lists; room for `capacity` neighbours a ball.
  void reset(std::size_t slots, std::size_t capacity) {
    stride_ = capacity + 1;
    entries_.assign(slots * stride_ + kSearchStep, 0);
    homes_.assign(slots, CellCoordinates{});
  }

  /// Makes room for more neighbours a ball; the lists stay.
  void widen(std::size_t capacity) {
    const std::size_t narrow = std::exchange(stride_, capacity + 1);
    const HugePageVector<Slot> old = std::move(entries_);
    entries_.assign(homes_.size() * stride_ + kSearchStep, 0);
    for (std::size_t slot = 0; slot < homes_.size(); ++slot) {
      std::copy_n(&old[slot * narrow], narrow, &entries_[slot * stride_]);
    }
  }

  void resize(std::size_t slots) {
    entries_.resize(slots * stride_ + kSearchStep);
    homes_.resize(slots);
  }

  std::size_t capacity() const { return stride_ - 1; }

  const Slot* of(Slot slot) const { return &entries_[slot * stride_ + 1]; }
  std::size_t count(Slot slot) const { return entries_[slot * stride_]; }

  /// In points of the lattice.
  const CellCoordinates& home(Slot slot) const { return homes_[slot]; }
  void setHome(Slot slot, const CellCoordinates& home) { homes_[slot] = home; }

  /// Gives a ball a list, and does not tell the neighbours.
  /// @return false, and nothing changed, when there is no room
  bool set(Slot slot, const std::vector<Slot>& neighbours) {
    if (neighbours.size() > capacity()) return false;
    std::copy(neighbours.begin(), neighbours.end(), begin(slot));
    countOf(slot) = static_cast<Slot>(neighbours.size());
    return true;
  }

  /// Gives a ball a new list, and takes it out of and puts it into the others' accordingly.
  /// @return false, and nothing changed, when some list has no room
  bool replace(Slot slot, const std::vector<Slot>& neighbours) {
    if (neighbours.size() > capacity()) return false;
    newcomers_.clear();
    for (const Slot other : neighbours) {
      if (isAmong(other, begin(slot), count(slot))) continue;
      if (count(other) == capacity()) return false;
      newcomers_.push_back(other);
    }
    for (Slot* old = begin(slot); old != end(slot); ++old) {
      if (!isAmong(*old, neighbours.data(), neighbours.size())) erase(*old, slot);
    }
    for (const Slot other : newcomers_) {
      *end(other) = slot;
      ++countOf(other);
    }
    return set(slot, neighbours);
  }

  /// Fetches a list from memory.
  void prefetch(Slot slot) const { __builtin_prefetch(&entries_[slot * stride_]); }

  std::size_t bytes() const {
    return entries_.capacity() * sizeof(Slot) + homes_.capacity() * sizeof(CellCoordinates);
  }

 private:
  Slot* begin(Slot slot) { return &entries_[slot * stride_ + 1]; }
  Slot* end(Slot slot) { return begin(slot) + count(slot); }
  Slot& countOf(Slot slot) { return entries_[slot * stride_]; }

  // Lists are short: to look at all of one is faster than to guess where to stop.
  static bool isAmong(Slot slot, const Slot* list, std::size_t count) {
    bool found = false;
    for (std::size_t i = 0; i < count; ++i) found |= list[i] == slot;
    return found;
  }

  void erase(Slot from, Slot slot) {
    Slot* const list = begin(from);
    const Slot last = list[--countOf(from)];
    for (std::size_t i = 0; i < count(from); ++i) list[i] = list[i] == slot ? last : list[i];
  }

  std::size_t stride_ = 1;
  HugePageVector<Slot> entries_;  // a count and a list for each slot
  HugePageVector<CellCoordinates> homes_;
  std::vector<Slot> newcomers_;  // scratch
};

}  // namespace ball_sim::core
