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
#include "fetch_ahead.hpp"
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
    lists_.assign(slots, List{});
    rows_.clear();
    free_row_ = kNoRow;
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
    lists_.resize(slots);
    homes_.resize(slots);
  }

  /// Once all have their first lists: makes room for as many long ones as may come.
  void makeRoom() {
    const std::size_t rows = rows_.size() / row_length_;
    const std::size_t most = std::max(rows + rows / 4, lists_.size() / kListsPerRow);
    rows_.reserve((most + kSpareRows) * row_length_);
  }

  /// The balls have got other slots.
  /// @param to     by the slots they had, those they have; a permutation
  /// @param slots  so many are in use
  void renumber(const std::vector<Slot>& to, std::size_t slots) {
    for (Slot slot = 0; slot < to.size(); ++slot) {
      for (Slot* other = begin(slot); other != end(slot); ++other) *other = to[*other];
      std::fill(end(slot), begin(slot) + capacity(slot), Slot{0});  // who stood there may be gone
    }
    exchangeToPlaces(to.size(), to, moved_, [this](Slot a, Slot b) {
      std::swap(homes_[a], homes_[b]);
      std::swap(lists_[a], lists_[b]);
    });
    resize(slots);
  }

  const Slot* of(Slot slot) const {
    const List& list = lists_[slot];
    return isLong(list.count) ? &rows_[list.slots[0] * row_length_] : list.slots.data();
  }
  std::size_t count(Slot slot) const { return lists_[slot].count; }

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
    forEach(slot, [this](Slot old) { homes_[old].mark = Mark::old; });
    for (std::size_t i = 0; i < near_count_; ++i) {
      const Slot other = near_[i];
      if (homes_[other].mark == Mark::old) {
        homes_[other].mark = Mark::kept;
      } else {
        add(other, slot);
      }
    }
    forEach(slot, [this, slot](Slot old) {
      if (homes_[old].mark == Mark::old) erase(old, slot);
      homes_[old].mark = Mark::none;
    });
    takeNear(slot);
  }

  /// Fetches a list from memory.
  void fetch(Slot slot) const { fetchAhead(&lists_[slot]); }
  void fetchHome(Slot slot) const { fetchAhead(&homes_[slot]); }

  std::size_t bytes() const {
    return lists_.capacity() * sizeof(List) + rows_.capacity() * sizeof(Slot) +
           homes_.capacity() * sizeof(Home) + moved_.capacity() / 8;
  }

 private:
  static constexpr std::size_t kMostInPlace = 15;
  // One in 12 lists is long in a fluid of packing fraction 0.49, fewer elsewhere.
  static constexpr std::size_t kListsPerRow = 10;
  static constexpr std::size_t kSpareRows = 16;
  static constexpr Slot kNoRow = kNoSlot;

  // One cache line. Long lists, which are few, lie in rows elsewhere: the first entry tells which.
  // Searches may read the count as if it were a slot (see kSearchStep), and there is such a slot.
  struct alignas(64) List {
    std::array<Slot, kMostInPlace> slots{};
    Slot count = 0;
  };

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
    if (near_.size() < candidate_count) near_.resize(2 * candidate_count);
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
    near_count_ = count;
  }

  void takeNear(Slot slot) {
    std::copy_n(near_.begin(), near_count_, changeCount(slot, near_count_));
  }

  void add(Slot to, Slot slot) {
    List& list = lists_[to];
    if (list.count < kMostInPlace) {
      list.slots[list.count++] = slot;
    } else {
      const std::size_t before = list.count;
      changeCount(to, before + 1)[before] = slot;
    }
  }

  // Lists are short: to look at all of one, and beyond, is faster than to guess where to stop.
  void erase(Slot from, Slot slot) {
    List& list = lists_[from];
    if (isLong(list.count)) {
      const std::size_t left = list.count - 1;
      Slot* const row = begin(from);
      std::replace(row, row + left, slot, row[left]);
      changeCount(from, left);
    } else {
      const Slot last = list.slots[--list.count];
      for (Slot& other : list.slots) other = other == slot ? last : other;
    }
  }

  // Makes a list longer or shorter, where there is room for it. @return where it begins
  Slot* changeCount(Slot slot, std::size_t count) {
    List& list = lists_[slot];
    if (isLong(count) && count > row_length_) widenRows(count);
    if (isLong(count) != isLong(list.count)) isLong(count) ? moveToRow(list) : moveToPlace(list);
    list.count = static_cast<Slot>(count);
    return begin(slot);
  }

  // While the list stays.
  template <class Function>
  void forEach(Slot slot, const Function& f) const {
    const Slot* const list = of(slot);
    const std::size_t count = this->count(slot);
    for (std::size_t i = 0; i < count; ++i) f(list[i]);
  }

  void moveToRow(List& list) {
    const Slot row = takeRow();
    Slot* const begin = &rows_[row * row_length_];
    // What another list has left may be slots that are gone.
    std::fill(std::copy(list.slots.begin(), list.slots.end(), begin), begin + row_length_, Slot{0});
    list.slots[0] = row;
  }

  void moveToPlace(List& list) {
    const Slot row = list.slots[0];
    std::copy_n(&rows_[row * row_length_], kMostInPlace, list.slots.begin());
    rows_[row * row_length_] = std::exchange(free_row_, row);
  }

  Slot takeRow() {
    if (free_row_ != kNoRow) return std::exchange(free_row_, rows_[free_row_ * row_length_]);
    const std::size_t rows = rows_.size() / row_length_;
    rows_.resize((rows + 1) * row_length_);
    return static_cast<Slot>(rows);
  }

  // Makes room for longer lists; what the rows hold stays.
  void widenRows(std::size_t length) {
    const std::size_t narrow = std::exchange(row_length_, (length / 16 + 1) * 16);
    const HugePageVector<Slot> old = std::exchange(rows_, {});
    const std::size_t rows = old.size() / narrow;
    rows_.resize(rows * row_length_);
    for (std::size_t row = 0; row < rows; ++row) {
      std::copy_n(&old[row * narrow], narrow, &rows_[row * row_length_]);
    }
  }

  static bool isLong(std::size_t count) { return __builtin_expect(count > kMostInPlace, 0) != 0; }

  std::size_t capacity(Slot slot) const { return isLong(count(slot)) ? row_length_ : kMostInPlace; }
  Slot* begin(Slot slot) { return const_cast<Slot*>(of(slot)); }
  Slot* end(Slot slot) { return begin(slot) + count(slot); }

  HugePageVector<List> lists_;
  HugePageVector<Slot> rows_;    // of the long lists
  std::size_t row_length_ = 32;  // a multiple of kSearchStep
  Slot free_row_ = kNoRow;       // the one used last; its first entry tells of another
  HugePageVector<Home> homes_;
  Whole width_{};
  Whole round_{};
  Metres spacing_{};
  float squared_reach_ = 0;
  // Scratch of a new list, and room for more than are ever around one of equal balls.
  std::vector<Slot> near_ = std::vector<Slot>(256);
  std::size_t near_count_ = 0;
  std::vector<bool> moved_;  // scratch of renumber()
};

}  // namespace ball_sim::core
