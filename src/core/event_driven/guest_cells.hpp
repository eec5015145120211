// The guests of a level of cells: the balls of all finer levels, in cells of their own.
//
// These are as wide as the members' cells, or halved a few times. A member of the level, their
// host, is at home in one of them, and meets guests only in those within its reach. So it need not
// look at all guests in the 27 members' cells around, of which there may be thousands to a member:
// at three halvings the cells within reach take but twice the room of a cell of the members'.
//
// The other way round, each of the halved cells knows whose reach it is in, so that a guest seldom
// has to look for hosts.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "event_driven/candidates.hpp"
#include "event_driven/cell_coordinates.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

/// The hosts that a cell is within reach of: how many, and, of a single one, who it is.
class Hosts {
 public:
  void add(Slot slot) {
    value_ ^= slot;
    if (value_ < kCrowded) value_ += kOne;
  }

  /// @param slot  that was added
  void remove(Slot slot) {
    value_ ^= slot;
    if (value_ < kCrowded) value_ -= kOne;
  }

  bool none() const { return value_ < kOne; }
  bool isSingle() const { return value_ / kOne == 1; }
  Slot single() const { return value_ % kOne; }

 private:
  static constexpr std::uint32_t kOne = 1U << 27;        // more than any slot
  static constexpr std::uint32_t kCrowded = 31U * kOne;  // or more: nobody knows how many

  // So many times kOne as there are hosts; below, their slots, combined by exclusive or, which
  // undoes itself.
  std::uint32_t value_ = 0;
};

/// Guests by cell, and what of them is within reach of a home.
class GuestCells {
 public:
  /// How one axis is cut.
  struct Axis {
    std::int32_t cells = 1;  ///< from end to end
    bool periodic = false;
    bool open = false;  ///< coordinates are taken modulo `cells`, a power of two
    double edge = 1;    ///< m
  };

  /// @param reach     m, >= 0: no host touches a guest farther away
  /// @param halvings  of the members' cells, 0 to 5
  GuestCells(const std::array<Axis, 3>& axes, double reach, int halvings)
      : axes_(axes), squared_reach_(reach * reach), halvings_(halvings) {
    std::array<std::int32_t, 3> lower, upper;
    std::uint32_t stride = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const Axis& axis = axes_[k];
      // Each cell once, where there are few.
      const std::int32_t most = 1 + static_cast<std::int32_t>(reach / axis.edge);
      lower[k] = -std::min(most, wraps(axis) ? (axis.cells - 1) / 2 : axis.cells - 1);
      upper[k] = std::min(most, wraps(axis) ? axis.cells / 2 : axis.cells - 1);
      numbers_[k] = numbersOf(axis, std::max(-lower[k], upper[k]), stride);
      stride *= static_cast<std::uint32_t>(axis.cells) + 1;
    }
    listOffsets(lower, upper);
    heads_.assign(stride, kNoSlot);
    if (halvings_ > 0) hosts_.resize(stride);
  }

  /// Of the members' cells.
  int halvings() const { return halvings_; }

  void resize(std::size_t slots) {
    next_.resize(slots, kNoSlot);
    previous_.resize(slots, kNoSlot);
  }

  void clear() {
    std::fill(heads_.begin(), heads_.end(), kNoSlot);
    std::fill(hosts_.begin(), hosts_.end(), Hosts{});
  }

  // --- guests

  std::uint32_t cellIndex(const CellCoordinates& c) const {
    return *numbers_[0].at(c[0]) + *numbers_[1].at(c[1]) + *numbers_[2].at(c[2]);
  }

  void link(Slot slot, std::uint32_t index) {
    const Slot head = heads_[index];
    next_[slot] = head;
    previous_[slot] = kNoSlot;
    if (head != kNoSlot) previous_[head] = slot;
    heads_[index] = slot;
  }

  void unlink(Slot slot, std::uint32_t index) {
    const Slot after = next_[slot];
    const Slot before = previous_[slot];
    if (after != kNoSlot) previous_[after] = before;
    (before != kNoSlot ? next_[before] : heads_[index]) = after;
  }

  /// Those whose reach a cell is in. Known only where cells are halved.
  Hosts hostsAt(std::uint32_t index) const { return hosts_[index]; }

  // --- hosts

  void addHost(Slot slot, const CellCoordinates& home) {
    if (halvings_ == 0) return;
    forEachCell(around_, home, [&](std::uint32_t index) { hosts_[index].add(slot); });
  }

  void removeHost(Slot slot, const CellCoordinates& home) {
    if (halvings_ == 0) return;
    forEachCell(around_, home, [&](std::uint32_t index) { hosts_[index].remove(slot); });
  }

  /// Moves a host to the adjacent home along `axis` towards `direction` (-1 or +1).
  void moveHost(Slot slot, const CellCoordinates& from, const CellCoordinates& to, std::size_t axis,
                int direction) {
    if (halvings_ == 0) return;
    forEachCell(ahead(axis, -direction), from,
                [&](std::uint32_t index) { hosts_[index].remove(slot); });
    forEachCell(ahead(axis, direction), to, [&](std::uint32_t index) { hosts_[index].add(slot); });
  }

  /// Adds the guests within reach of a home.
  void gather(const CellCoordinates& home, Candidates& candidates) const {
    gatherFrom(around_, home, candidates);
  }

  /// The same, but only those that were not so from the home before, when the host has crossed
  /// into this one along `axis` towards `direction` (-1 or +1).
  void gatherNew(const CellCoordinates& home, std::size_t axis, int direction,
                 Candidates& candidates) const {
    gatherFrom(ahead(axis, direction), home, candidates);
  }

  std::size_t bytes() const {
    return (heads_.capacity() + next_.capacity() + previous_.capacity()) * sizeof(Slot) +
           hosts_.capacity() * sizeof(Hosts);
  }

 private:
  using Offsets = std::vector<std::array<std::int8_t, 3>>;

  // What each coordinate along an axis adds to the index of a cell.
  struct Numbers {
    std::int32_t mask = -1;  // of coordinates on open axes
    std::int32_t margin = 0;
    std::vector<std::uint32_t> of;

    // Whence one may look `margin` cells up and down.
    const std::uint32_t* at(std::int32_t coordinate) const {
      return of.data() + (margin + (coordinate & mask));
    }
  };

  static bool wraps(const Axis& axis) { return axis.periodic || axis.open; }

  // Beyond a wall lies the last cell, one more than there are, which is always empty.
  static Numbers numbersOf(const Axis& axis, std::int32_t margin, std::uint32_t stride) {
    Numbers numbers;
    numbers.margin = margin;
    if (axis.open) numbers.mask = axis.cells - 1;
    for (std::int32_t c = -margin; c < axis.cells + margin; ++c) {
      const std::int32_t within = (c + axis.cells) % axis.cells;
      const bool exists = wraps(axis) || (c >= 0 && c < axis.cells);
      numbers.of.push_back(static_cast<std::uint32_t>(exists ? within : axis.cells) * stride);
    }
    return numbers;
  }

  // The least distance along an axis between two cells so many apart, m^2; round about, if that is
  // nearer.
  double squaredGap(std::size_t k, std::int32_t apart) const {
    const Axis& axis = axes_[k];
    std::int32_t steps = std::abs(apart);
    if (wraps(axis)) steps = std::min(steps % axis.cells, axis.cells - steps % axis.cells);
    const double gap = std::max(0, steps - 1) * axis.edge;
    return gap * gap;
  }

  bool isWithinReach(const CellCoordinates& offset) const {
    return squaredGap(0, offset[0]) + squaredGap(1, offset[1]) + squaredGap(2, offset[2]) <=
           squared_reach_;
  }

  void listOffsets(const CellCoordinates& lower, const CellCoordinates& upper) {
    CellCoordinates o{};
    for (o[2] = lower[2]; o[2] <= upper[2]; ++o[2]) {
      for (o[1] = lower[1]; o[1] <= upper[1]; ++o[1]) {
        for (o[0] = lower[0]; o[0] <= upper[0]; ++o[0]) {
          if (isWithinReach(o)) listOffset(o);
        }
      }
    }
  }

  void listOffset(const CellCoordinates& offset) {
    const std::array<std::int8_t, 3> o = {static_cast<std::int8_t>(offset[0]),
                                          static_cast<std::int8_t>(offset[1]),
                                          static_cast<std::int8_t>(offset[2])};
    around_.push_back(o);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const int direction : {-1, 1}) {
        CellCoordinates from_home_before = offset;
        from_home_before[axis] += direction;
        if (!isWithinReach(from_home_before)) ahead_[axis][direction < 0 ? 0 : 1].push_back(o);
      }
    }
  }

  const Offsets& ahead(std::size_t axis, int direction) const {
    return ahead_[axis][direction < 0 ? 0 : 1];
  }

  // Calls f with the index of each cell.
  template <class Function>
  void forEachCell(const Offsets& offsets, const CellCoordinates& home, Function f) const {
    const std::uint32_t* const x = numbers_[0].at(home[0]);
    const std::uint32_t* const y = numbers_[1].at(home[1]);
    const std::uint32_t* const z = numbers_[2].at(home[2]);
    for (const auto& o : offsets) f(x[o[0]] + y[o[1]] + z[o[2]]);
  }

  void gatherFrom(const Offsets& offsets, const CellCoordinates& home,
                  Candidates& candidates) const {
    forEachCell(offsets, home, [&](std::uint32_t index) {
      for (Slot s = heads_[index]; s != kNoSlot; s = next_[s]) candidates.add(s);
    });
  }

  std::array<Axis, 3> axes_;
  double squared_reach_;  // m^2
  int halvings_;
  std::array<Numbers, 3> numbers_;
  Offsets around_;                               // of the cells within reach of a home
  std::array<std::array<Offsets, 2>, 3> ahead_;  // of those not within reach one home back
  std::vector<Slot> heads_;                      // of the lists of guests, by cell
  std::vector<Slot> next_;                       // in a list of guests
  std::vector<Slot> previous_;
  std::vector<Hosts> hosts_;  // by cell; none where cells are not halved
};

}  // namespace ball_sim::core
