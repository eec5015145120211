// The cell grid: who is near whom, at any ratio of sizes.
//
// Space is cut into cells, a level of them for each size class: level 0 has the coarsest, each
// level halves the cells' edges `depth` times. A ball is a member of the finest level whose cells
// are at least as wide as the ball, and a guest of the populated levels above. Two balls that touch
// are then in the same or adjacent cells of the level of the larger one, so a ball looks at the
// members of its own and all coarser levels, and at the guests of its own.
//
// An axis is closed (cells from wall to wall), periodic, or open. On an open axis a cell index is
// taken modulo the number of cells, so the grid reaches everywhere: balls that share a cell by
// chance only cost a look. Which cell a ball is in is decided by its crossings, not by rounding its
// place.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

/// Coordinates of a cell along the axes, in the cells of one level.
using CellCoordinates = std::array<std::int32_t, 3>;

/// The place of a cell along Morton's space-filling curve (1966), which keeps near what is near.
inline std::uint64_t mortonKey(const CellCoordinates& c) {
  std::uint64_t key = 0;
  for (int bit = 0; bit < 21; ++bit) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto coordinate = static_cast<std::uint32_t>(c[static_cast<std::size_t>(axis)]);
      key |= std::uint64_t{(coordinate >> bit) & 1} << (3 * bit + axis);
    }
  }
  return key;
}

/// The adjacent cells of one cell along one axis: lower, itself, upper.
struct AxisNeighbours {
  std::array<std::uint32_t, 3> cell{};  ///< part of the cell's index
  std::uint8_t begin = 1;               ///< first that there is
  std::uint8_t end = 2;                 ///< behind the last
};

/// The balls found near a ball.
struct Candidates {
  std::vector<Slot> slots;
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

/// The balls in one cell: the first few beside each other, so that they are copied without a
/// branch on how many there are.
struct alignas(16) Cell {
  static constexpr std::uint8_t kMostInPlace = 3;

  /// In a chained cell the last of these is the head of a chain that holds the third and later.
  std::array<Slot, kMostInPlace> slots = {kNoSlot, kNoSlot, kNoSlot};
  std::uint8_t in_place = 0;    ///< so many of them are valid
  std::uint8_t is_chained = 0;  ///< 1: there are more than fit in place
};

/// One level of cells, and who is in them.
class CellLevel {
 public:
  /// @param depth  times the coarsest edges are halved
  /// @param counts cells along each axis
  CellLevel(int depth, const std::array<std::uint32_t, 3>& counts,
            const std::array<bool, 3>& periodic, const std::array<bool, 3>& open)
      : depth_(depth) {
    std::uint32_t stride = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      mask_[axis] = open[axis] ? static_cast<std::int32_t>(counts[axis]) - 1 : -1;
      const bool wraps = periodic[axis] || open[axis];
      neighbours_[axis] = axisNeighbours(counts[axis], wraps, stride);
      // One more, always empty, is the neighbour where there is none. A single plane that nobody
      // leaves is never asked for its neighbours.
      stride *= axis < 2 || counts[axis] > 1 || wraps ? counts[axis] + 1 : 1;
    }
    cells_.resize(stride);
  }

  int depth() const { return depth_; }

  /// @param coordinates  in cells of this level
  std::uint32_t cellIndex(const CellCoordinates& coordinates) const {
    return neighbours(0, coordinates[0]).cell[1] + neighbours(1, coordinates[1]).cell[1] +
           neighbours(2, coordinates[2]).cell[1];
  }

  const AxisNeighbours& neighbours(std::size_t axis, std::int32_t coordinate) const {
    return neighbours_[axis][static_cast<std::size_t>(coordinate & mask_[axis])];
  }

  void expectGuests() { guests_.assign(cells_.size(), kNoSlot); }
  bool hasGuests() const { return !guests_.empty(); }

  void resize(std::size_t slots) {
    next_.resize(slots, kNoSlot);
    if (hasGuests()) previous_.resize(slots, kNoSlot);
  }

  void clear() {
    std::fill(cells_.begin(), cells_.end(), Cell{});
    std::fill(guests_.begin(), guests_.end(), kNoSlot);
  }

  void link(Slot slot, std::uint32_t index) {
    Cell& cell = cells_[index];
    if (cell.in_place < Cell::kMostInPlace) {
      cell.slots[cell.in_place++] = slot;
      return;
    }
    if (!cell.is_chained) next_[cell.slots.back()] = kNoSlot;
    next_[slot] = std::exchange(cell.slots.back(), slot);
    cell.is_chained = 1;
  }

  void unlink(Slot slot, std::uint32_t index) {
    Cell& cell = cells_[index];
    if (cell.is_chained) return unlinkFromChain(slot, cell);
    // What stands behind the valid ones may be anybody: the first is the right one.
    const std::size_t i = cell.slots[0] == slot ? 0 : cell.slots[1] == slot ? 1 : 2;
    cell.slots[i] = cell.slots[--cell.in_place];
  }

  void linkGuest(Slot slot, std::uint32_t index) {
    const Slot head = guests_[index];
    next_[slot] = head;
    previous_[slot] = kNoSlot;
    if (head != kNoSlot) previous_[head] = slot;
    guests_[index] = slot;
  }

  void unlinkGuest(Slot slot, std::uint32_t index) {
    const Slot after = next_[slot];
    const Slot before = previous_[slot];
    if (after != kNoSlot) previous_[after] = before;
    (before != kNoSlot ? next_[before] : guests_[index]) = after;
  }

  /// Adds the members of the 27 cells around `c`, and the guests there if `with_guests`.
  void gather(const CellCoordinates& c, bool with_guests, Candidates& candidates) const {
    const Block<3> cells{neighbours(0, c[0]).cell, neighbours(1, c[1]).cell, neighbours(2, c[2])};
    gatherBlock(cells, with_guests, candidates);
  }

  /// The same of their layer at `direction` (-1 lower, +1 upper) of `axis` alone.
  void gatherLayer(const CellCoordinates& c, std::size_t axis, int direction, bool with_guests,
                   Candidates& candidates) const {
    // Not by a branch on the axis, which cannot be foretold.
    constexpr std::array<std::uint8_t, 3> kAlong = {1, 0, 0}, kAcross = {2, 2, 1};
    const std::size_t along = kAlong[axis], across = kAcross[axis];
    const auto side = static_cast<unsigned>(1 + direction);
    const Block<1> cells{neighbours(along, c[along]).cell,
                         {neighbours(axis, c[axis]).cell[side]},
                         neighbours(across, c[across])};
    gatherBlock(cells, with_guests, candidates);
  }

  std::size_t bytes() const {
    std::size_t bytes =
        cells_.capacity() * sizeof(Cell) +
        (guests_.capacity() + next_.capacity() + previous_.capacity()) * sizeof(Slot);
    for (const auto& axis : neighbours_) bytes += axis.capacity() * sizeof(AxisNeighbours);
    return bytes;
  }

 private:
  // Adjacent cells: parts of their indices along three axes, in any order of the axes.
  template <std::size_t kRows>
  struct Block {
    std::array<std::uint32_t, 3> columns;
    std::array<std::uint32_t, kRows> rows;
    const AxisNeighbours& planes;  // those that there are

    // Calls f with each cell's row, and its column there, whose sum is its index.
    template <class Function>
    void forEach(Function f) const {
      const std::size_t x0 = columns[0], x1 = columns[1], x2 = columns[2];
      const std::array<std::uint32_t, kRows> y = rows;
      const std::size_t end = planes.end;
      for (std::size_t k = planes.begin; k != end; ++k) {
        const std::uint32_t z = planes.cell[k];
        for (const std::uint32_t row : y) {
          f(z + row, x0);
          f(z + row, x1);
          f(z + row, x2);
        }
      }
    }
  };

  template <std::size_t kRows>
  void gatherBlock(const Block<kRows>& block, bool with_guests, Candidates& candidates) const {
    candidates.reserve(9 * kRows * sizeof(Cell) / sizeof(Slot));
    const Cell* const cells = cells_.data();
    Slot* const begin = candidates.slots.data() + candidates.count;
    Slot* at = begin;
    unsigned is_chained = 0;
    block.forEach([&](std::size_t row, std::size_t column) {
      const Cell* const cell = cells + row + column;
      // All is copied, without asking what there is: what is too much is overwritten by the next.
      std::memcpy(at, cell, sizeof(Cell));
      at += cell->in_place;
      is_chained |= cell->is_chained;
    });
    candidates.count += static_cast<std::size_t>(at - begin);
    if (is_chained != 0) gatherChains(block, candidates);
    if (!with_guests) return;
    block.forEach([&](std::size_t row, std::size_t column) {
      for (Slot s = guests_[row + column]; s != kNoSlot; s = next_[s]) candidates.add(s);
    });
  }

  // What cells hold beyond the first few. Which have more cannot be foretold either.
  template <std::size_t kRows>
  void gatherChains(const Block<kRows>& block, Candidates& candidates) const {
    std::array<Slot, 9 * kRows + 1> heads;
    std::size_t count = 0;
    block.forEach([&](std::size_t row, std::size_t column) {
      const Cell& cell = cells_[row + column];
      heads[count] = cell.slots.back();
      count += cell.is_chained;
    });
    for (std::size_t i = 0; i < count; ++i) {
      for (Slot s = next_[heads[i]]; s != kNoSlot; s = next_[s]) candidates.add(s);
    }
  }

  void unlinkFromChain(Slot slot, Cell& cell) {
    if (cell.slots[0] == slot || cell.slots[1] == slot) {  // the gap takes the chain's head
      const Slot head = std::exchange(cell.slots.back(), next_[cell.slots.back()]);
      cell.slots[cell.slots[0] == slot ? 0 : 1] = head;
    } else {
      Slot* at = &cell.slots.back();
      while (*at != slot) at = &next_[*at];
      *at = next_[slot];
    }
    cell.is_chained = next_[cell.slots.back()] != kNoSlot ? 1 : 0;
  }

  // On an axis of one or two cells that wraps the neighbours are cells already listed.
  static std::vector<AxisNeighbours> axisNeighbours(std::uint32_t count, bool wraps,
                                                    std::uint32_t stride) {
    std::vector<AxisNeighbours> table(count);
    for (std::uint32_t c = 0; c < count; ++c) {
      AxisNeighbours& near = table[c];
      near.begin = c > 0 || (wraps && count > 2) ? 0 : 1;
      near.end = c + 1 < count || (wraps && count > 2) ? 3 : 2;
      near.cell = {count * stride, c * stride, count * stride};  // where none is: the empty cell
      if (near.begin == 0) near.cell[0] = (c > 0 ? c - 1 : count - 1) * stride;
      if (near.end == 3) near.cell[2] = (c + 1 < count ? c + 1 : 0) * stride;
    }
    return table;
  }

  int depth_;
  std::array<std::int32_t, 3> mask_{};  // of coordinates on open axes; all ones elsewhere
  std::array<std::vector<AxisNeighbours>, 3> neighbours_;
  HugePageVector<Cell> cells_;  // members
  std::vector<Slot> guests_;    // heads of the lists of balls of finer levels; empty without any
  std::vector<Slot> next_;      // in a cell's chain, or a list of guests
  std::vector<Slot> previous_;  // in a list of guests
};

/// How one axis is cut.
template <class Real>
struct GridAxis {
  Real origin = 0;  ///< m, lower end of cell 0
  bool periodic = false;
  bool flat = false;        ///< all balls share one coordinate: one cell, no crossings
  bool lower_wall = false;  ///< a box face at the lower end of cell 0
  bool upper_wall = false;  ///< a box face at the upper end of the last cell
  std::uint32_t cells = 1;  ///< at depth 0
  Real edge = 1;            ///< m, at depth 0

  bool open() const { return !periodic && !flat && !(lower_wall && upper_wall); }
};

/// Cubes on a lattice: the cells of a level, or the regions around homes.
template <class Real>
struct Lattice {
  std::array<Real, 3> first{};    ///< m, middle of the cube at coordinate 0
  std::array<Real, 3> spacing{};  ///< m
  std::array<Real, 3> half{};     ///< m, half the edge of a cube
  /// Coordinates, along each axis, of the cubes that have no way out towards lower and upper.
  std::array<std::array<std::int32_t, 2>, 3> end{};
  bool has_ends = false;  ///< whether there are any such
};

/// All levels, and the geometry they share.
template <class Real>
class CellGrid {
 public:
  CellGrid() = default;

  /// @param depths  of the populated levels, ascending, at least one
  CellGrid(const std::array<GridAxis<Real>, 3>& axes, const std::vector<int>& depths)
      : axes_(axes) {
    const std::array<bool, 3> periodic = {axes[0].periodic, axes[1].periodic, axes[2].periodic};
    const std::array<bool, 3> open = {axes[0].open(), axes[1].open(), axes[2].open()};
    for (const int depth : depths) {
      std::array<std::uint32_t, 3> counts{};
      for (std::size_t k = 0; k < 3; ++k) counts[k] = axes[k].cells << (axes[k].flat ? 0 : depth);
      levels_.emplace_back(depth, counts, periodic, open);
    }
    for (std::size_t i = 0; i + 1 < levels_.size(); ++i) levels_[i].expectGuests();
    for (std::size_t level = 0; level < levels_.size(); ++level) {
      lattices_.push_back(lattice(levels_[level].depth()));
      for (std::size_t k = 0; k < 3; ++k) {
        lattices_[level].has_ends |= axes_[k].lower_wall || axes_[k].upper_wall;
        if (axes_[k].lower_wall) lattices_[level].end[k][0] = 0;
        if (axes_[k].upper_wall) lattices_[level].end[k][1] = count(k, level) - 1;
      }
    }
  }

  /// Cells whose edges are halved `depth` times. Only flat axes have ends.
  Lattice<Real> lattice(int depth) const {
    using std::ldexp;
    Lattice<Real> lattice;
    for (std::size_t k = 0; k < 3; ++k) {
      lattice.spacing[k] = ldexp(axes_[k].edge, -depth);
      lattice.half[k] = lattice.spacing[k] / 2;
      lattice.first[k] = axes_[k].origin + lattice.half[k];
      if (axes_[k].flat) {
        lattice.has_ends = true;
        continue;
      }
      lattice.end[k] = {std::numeric_limits<std::int32_t>::min(),
                        std::numeric_limits<std::int32_t>::max()};
    }
    return lattice;
  }

  const Lattice<Real>& latticeOf(std::size_t level) const { return lattices_[level]; }

  const GridAxis<Real>& axis(std::size_t k) const { return axes_[k]; }
  std::vector<CellLevel>& levels() { return levels_; }
  const std::vector<CellLevel>& levels() const { return levels_; }

  /// Edge of a cell, m.
  Real edge(std::size_t axis, std::size_t level) const { return lattices_[level].spacing[axis]; }

  /// Number of cells from end to end of a bounded axis.
  std::int32_t count(std::size_t axis, std::size_t level) const {
    return static_cast<std::int32_t>(axes_[axis].cells << levels_[level].depth());
  }

  /// Whether a box face bounds the cells at a coordinate, towards `direction` (-1 or +1).
  bool isWall(std::size_t axis, std::size_t level, std::int32_t coordinate, int direction) const {
    if (direction < 0) return axes_[axis].lower_wall && coordinate == 0;
    return axes_[axis].upper_wall && coordinate == lattices_[level].end[axis][1];
  }

  /// The cell around a place, in cells whose edges are halved `depth` times.
  CellCoordinates coordinatesOf(const VectorOf<Real>& x, int depth) const {
    using std::floor;
    using std::ldexp;
    CellCoordinates c{};
    for (std::size_t k = 0; k < 3; ++k) {
      const GridAxis<Real>& axis = axes_[k];
      if (axis.flat) continue;
      const Real edge = ldexp(axis.edge, -depth);
      c[k] = static_cast<std::int32_t>(floor((x[static_cast<int>(k)] - axis.origin) / edge));
      const auto last = static_cast<std::int32_t>(axis.cells << depth) - 1;
      if (axis.lower_wall || axis.periodic) c[k] = std::max(c[k], 0);
      if (axis.upper_wall || axis.periodic) c[k] = std::min(c[k], last);
    }
    return c;
  }

  /// The same cell in the coordinates of a lesser depth.
  static CellCoordinates coarser(const CellCoordinates& c, int depth, int lesser) {
    const int shift = depth - lesser;
    return {c[0] >> shift, c[1] >> shift, c[2] >> shift};
  }

  /// Cells once round a periodic axis, of cells whose edges are halved `depth` times; on others so
  /// many that the way round is never the shorter.
  std::int32_t pointsRound(std::size_t axis, int depth) const {
    if (!axes_[axis].periodic) return std::numeric_limits<std::int32_t>::max();
    return static_cast<std::int32_t>(axes_[axis].cells << depth);
  }

  void resize(std::size_t slots) {
    for (CellLevel& level : levels_) level.resize(slots);
  }

  /// Takes all balls out.
  void clear() {
    for (CellLevel& level : levels_) level.clear();
  }

  /// Puts a ball into its level and, as a guest, into all coarser ones.
  void link(Slot slot, const CellCoordinates& coordinates, std::size_t level) {
    levels_[level].link(slot, levels_[level].cellIndex(coordinates));
    for (std::size_t m = 0; m < level; ++m) {
      levels_[m].linkGuest(slot, levels_[m].cellIndex(inLevel(coordinates, level, m)));
    }
  }

  void unlink(Slot slot, const CellCoordinates& coordinates, std::size_t level) {
    levels_[level].unlink(slot, levels_[level].cellIndex(coordinates));
    for (std::size_t m = 0; m < level; ++m) {
      levels_[m].unlinkGuest(slot, levels_[m].cellIndex(inLevel(coordinates, level, m)));
    }
  }

  /// Moves a ball to the adjacent cell of its level along `axis`.
  void move(Slot slot, const CellCoordinates& from, const CellCoordinates& to, std::size_t axis,
            std::size_t level) {
    CellLevel& own = levels_[level];
    const std::uint32_t before = own.cellIndex(from);
    own.unlink(slot, before);
    own.link(slot, before - own.neighbours(axis, from[axis]).cell[1] +
                       own.neighbours(axis, to[axis]).cell[1]);
    for (std::size_t m = 0; m < level; ++m) {
      const std::uint32_t was_in = levels_[m].cellIndex(inLevel(from, level, m));
      const std::uint32_t is_in = levels_[m].cellIndex(inLevel(to, level, m));
      if (was_in == is_in) continue;
      levels_[m].unlinkGuest(slot, was_in);
      levels_[m].linkGuest(slot, is_in);
    }
  }

  /// Finds all balls that can touch one at these coordinates of `level` before anyone crosses,
  /// itself included.
  void gatherNear(const CellCoordinates& coordinates, std::size_t level,
                  Candidates& candidates) const {
    candidates.count = 0;
    const CellLevel& own = levels_[level];
    own.gather(coordinates, own.hasGuests(), candidates);
    for (std::size_t m = 0; m < level; ++m) {
      levels_[m].gather(inLevel(coordinates, level, m), false, candidates);
    }
    candidates.close();
  }

  /// The same, but only the layer of cells that came near when the ball crossed into these
  /// coordinates along `axis` towards `direction` (-1 or +1), on the levels where cells were
  /// crossed at all.
  void gatherNewLayer(const CellCoordinates& after, std::size_t level, std::size_t axis,
                      int direction, Candidates& candidates) const {
    candidates.count = 0;
    const CellLevel& own = levels_[level];
    own.gatherLayer(after, axis, direction, own.hasGuests(), candidates);
    for (std::size_t m = 0; m < level; ++m) {
      const int shift = own.depth() - levels_[m].depth();
      if ((after[axis] - direction) >> shift == after[axis] >> shift) continue;
      levels_[m].gatherLayer(inLevel(after, level, m), axis, direction, false, candidates);
    }
    candidates.close();
  }

  /// Finds, of its own level alone, the balls that will be new to one that crosses next.
  void foreseeNewLayer(const CellCoordinates& before, std::size_t level, std::size_t axis,
                       int direction, Candidates& candidates) const {
    candidates.count = 0;
    levels_[level].gatherLayer(behind(before, level, axis, direction), axis, direction, false,
                               candidates);
  }

  std::size_t bytes() const {
    std::size_t bytes = 0;
    for (const CellLevel& level : levels_) bytes += level.bytes();
    return bytes;
  }

 private:
  CellCoordinates inLevel(const CellCoordinates& c, std::size_t level, std::size_t coarse) const {
    return coarser(c, levels_[level].depth(), levels_[coarse].depth());
  }

  // The next cell, in the periodic box.
  CellCoordinates behind(CellCoordinates c, std::size_t level, std::size_t axis,
                         int direction) const {
    c[axis] += direction;
    if (!axes_[axis].periodic) return c;
    const std::int32_t cells = count(axis, level);
    c[axis] = c[axis] < 0 ? cells - 1 : c[axis] == cells ? 0 : c[axis];
    return c;
  }

  std::array<GridAxis<Real>, 3> axes_;
  std::vector<CellLevel> levels_;        // coarsest first
  std::vector<Lattice<Real>> lattices_;  // by level
};

}  // namespace ball_sim::core
