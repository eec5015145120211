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
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "event_driven/cell_grid.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"
#include "permutation.hpp"

namespace ball_sim::core {

/// The regions around homes, in points of the lattice of homes.
struct Regions {
  CellCoordinates width{};         ///< edges of a region
  CellCoordinates round{};         ///< once round a periodic box; else more than any two are apart
  std::array<float, 3> spacing{};  ///< of the points, m
  float reach = 0;                 ///< m, largest sum of two radii
};

class NeighbourLists {
 public:
  /// Half the edge of a region, of the largest radius: wider regions are left less often, but have
  /// longer lists.
  static constexpr double kHalfRegion = 0.4;

  /// Homes lie on a lattice this many halvings finer than the cells.
  static constexpr int kLatticeDepth = 5;

  /// Forgets all lists.
  void reset(std::size_t slots, const Regions& regions) {
    stride_ = std::max(stride_, kFewest + 1);
    entries_.assign(slots * stride_ + kSearchStep, 0);
    homes_.assign(slots, Home{});
    for (std::size_t k = 0; k < 3; ++k) {
      width_[k] = regions.width[k];
      round_[k] = regions.round[k];
      spacing_[k] = regions.spacing[k];
    }
    // Wider by more than these few digits can err.
    squared_reach_ = regions.reach * regions.reach * 1.00001F;
  }

  void resize(std::size_t slots) {
    entries_.resize(slots * stride_ + kSearchStep);
    homes_.resize(slots);
  }

  /// The balls have got other slots.
  /// @param to     by the slots they had, those they have; a permutation
  /// @param slots  so many are in use
  void renumber(const std::vector<Slot>& to, std::size_t slots) {
    for (Slot slot = 0; slot < to.size(); ++slot) {
      for (Slot* other = begin(slot); other != end(slot); ++other) *other = to[*other];
      std::fill(end(slot), begin(slot) + capacity(), Slot{0});  // who stood there may be gone
    }
    exchangeToPlaces(to.size(), to, moved_, [this](Slot a, Slot b) {
      std::swap(homes_[a], homes_[b]);
      std::swap_ranges(&countOf(a), &countOf(a) + stride_, &countOf(b));
    });
    resize(slots);
  }

  const Slot* of(Slot slot) const { return &entries_[slot * stride_ + 1]; }
  std::size_t count(Slot slot) const { return entries_[slot * stride_]; }

  /// In points of the lattice.
  const CellCoordinates& home(Slot slot) const { return homes_[slot].at; }
  void setHome(Slot slot, const CellCoordinates& home) { homes_[slot].at = home; }

  /// Gives a ball its first list, and does not tell the neighbours.
  /// @param candidates  all balls that might be near, perhaps itself among them
  void fill(Slot slot, const Slot* candidates, std::size_t count) {
    findNear(slot, candidates, count);
    takeNear(slot);
  }

  /// Gives a ball with a new home a new list, and takes it out of and puts it into the others'
  /// accordingly. Parameters as of fill().
  void renew(Slot slot, const Slot* candidates, std::size_t count) {
    findNear(slot, candidates, count);
    for (Slot* old = begin(slot); old != end(slot); ++old) homes_[*old].mark = Mark::old;
    for (const Slot other : near_) {
      if (homes_[other].mark == Mark::old) {
        homes_[other].mark = Mark::kept;
      } else {
        add(other, slot);
      }
    }
    for (Slot* old = begin(slot); old != end(slot); ++old) {
      if (homes_[*old].mark == Mark::old) erase(*old, slot);
      homes_[*old].mark = Mark::none;
    }
    takeNear(slot);
  }

  /// Fetches a list from memory.
  void prefetch(Slot slot) const { __builtin_prefetch(&entries_[slot * stride_]); }
  void prefetchHome(Slot slot) const { __builtin_prefetch(&homes_[slot]); }

  std::size_t bytes() const {
    return entries_.capacity() * sizeof(Slot) + homes_.capacity() * sizeof(Home) +
           moved_.capacity() / 8;
  }

 private:
  static constexpr std::size_t kFewest = 11;  // neighbours that there is room for

  enum class Mark : std::uint32_t { none, old, kept };

  struct alignas(16) Home {
    CellCoordinates at{};
    Mark mark = Mark::none;  // scratch of renew()
  };

  // Along three axes, and a fourth number to fill the register.
  using Whole = std::int32_t __attribute__((vector_size(16)));
  using Metres = float __attribute__((vector_size(16)));

  Whole homeOf(Slot slot) const {
    Whole home;
    std::memcpy(&home, &homes_[slot], sizeof(home));
    return home;
  }

  // Those whose regions come within reach of this ball's.
  void findNear(Slot slot, const Slot* candidates, std::size_t candidate_count) {
    const Whole home = homeOf(slot);
    near_.resize(candidate_count);
    std::size_t count = 0;
    for (std::size_t i = 0; i < candidate_count; ++i) {
      const Slot other = candidates[i];
      const Whole way = homeOf(other) - home;
      const Whole straight = way < 0 ? -way : way;
      const Whole roundabout = round_ - straight;
      const Whole gap = (straight < roundabout ? straight : roundabout) - width_;
      const Metres apart = __builtin_convertvector(gap > 0 ? gap : gap * 0, Metres) * spacing_;
      const Metres squares = apart * apart;
      // Without a branch, which would often be foretold wrongly.
      near_[count] = other;
      const bool is_near = squares[0] + squares[1] + squares[2] < squared_reach_;
      count += static_cast<std::size_t>(is_near & (other != slot));
    }
    near_.resize(count);
  }

  void takeNear(Slot slot) {
    if (near_.size() > capacity()) widen(near_.size());
    std::copy(near_.begin(), near_.end(), begin(slot));
    countOf(slot) = static_cast<Slot>(near_.size());
  }

  void add(Slot to, Slot slot) {
    if (count(to) == capacity()) widen(capacity() + 1);
    *end(to) = slot;
    ++countOf(to);
  }

  // Lists are short: to look at all of one is faster than to guess where to stop.
  void erase(Slot from, Slot slot) {
    Slot* const list = begin(from);
    const Slot last = list[--countOf(from)];
    for (std::size_t i = 0; i < count(from); ++i) list[i] = list[i] == slot ? last : list[i];
  }

  // Makes room for more neighbours a ball; the lists stay.
  void widen(std::size_t capacity) {
    const std::size_t narrow = std::exchange(stride_, capacity + 1);
    const HugePageVector<Slot> old = std::move(entries_);
    entries_.assign(homes_.size() * stride_ + kSearchStep, 0);
    for (std::size_t slot = 0; slot < homes_.size(); ++slot) {
      std::copy_n(&old[slot * narrow], narrow, &entries_[slot * stride_]);
    }
  }

  std::size_t capacity() const { return stride_ - 1; }
  Slot* begin(Slot slot) { return &entries_[slot * stride_ + 1]; }
  Slot* end(Slot slot) { return begin(slot) + count(slot); }
  Slot& countOf(Slot slot) { return entries_[slot * stride_]; }

  std::size_t stride_ = 1;
  HugePageVector<Slot> entries_;  // a count and a list for each slot
  HugePageVector<Home> homes_;
  Whole width_{};
  Whole round_{};
  Metres spacing_{};
  float squared_reach_ = 0;
  std::vector<Slot> near_;   // scratch of a new list
  std::vector<bool> moved_;  // scratch of renumber()
};

}  // namespace ball_sim::core
