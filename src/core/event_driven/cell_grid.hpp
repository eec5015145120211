// The cell grid: who is near whom, at any ratio of sizes.
//
// Space is cut into cells, a level of them for each size class: level 0 has the coarsest, each
// level halves the cells' edges `depth` times. A ball is a member of the finest level whose cells
// are at least as wide as the ball, and a guest of the populated levels above (guest_cells.hpp).
// Two balls that touch are then in the same or adjacent cells of the level of the larger one, so a
// ball looks at the members of its own and all coarser levels, and at the guests of its own.
//
// Where a ball is, is told by its home: a cell of its level, or, where many guests are, a halved
// one, since it then looks for guests from nearer by.
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
#include "event_driven/candidates.hpp"
#include "event_driven/cell_coordinates.hpp"
#include "event_driven/guest_cells.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"
#include "fetch_ahead.hpp"

namespace ball_sim::core {

/// The adjacent cells of one cell along one axis: lower, itself, upper.
struct AxisNeighbours {
  std::array<std::uint32_t, 3> cell{};  ///< part of the cell's index
  std::uint8_t begin = 1;               ///< first that there is
  std::uint8_t end = 2;                 ///< behind the last
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

/// One level of cells, and their members.
class CellLevel {
 public:
  /// @param counts cells along each axis
  CellLevel(const std::array<std::uint32_t, 3>& counts, const std::array<bool, 3>& periodic,
            const std::array<bool, 3>& open) {
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

  /// @param coordinates  in cells of this level
  std::uint32_t cellIndex(const CellCoordinates& coordinates) const {
    return neighbours(0, coordinates[0]).cell[1] + neighbours(1, coordinates[1]).cell[1] +
           neighbours(2, coordinates[2]).cell[1];
  }

  const AxisNeighbours& neighbours(std::size_t axis, std::int32_t coordinate) const {
    return neighbours_[axis][static_cast<std::size_t>(coordinate & mask_[axis])];
  }

  void resize(std::size_t slots) { next_.resize(slots, kNoSlot); }

  void clear() { std::fill(cells_.begin(), cells_.end(), Cell{}); }

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

  /// Adds the members of the 27 cells around `c`.
  void gather(const CellCoordinates& c, Candidates& candidates) const {
    gatherBlock(cellsAround(c), candidates);
  }

  /// The same of their layer at `direction` (-1 lower, +1 upper) of `axis` alone.
  void gatherLayer(const CellCoordinates& c, std::size_t axis, int direction,
                   Candidates& candidates) const {
    gatherBlock(layerAt(c, axis, direction), candidates);
  }

  /// Fetches a cell from memory, ...
  void fetch(const CellCoordinates& c) const { fetchAhead(&cells_[cellIndex(c)]); }
  /// ... those that gather() looks into, ...
  void fetchAround(const CellCoordinates& c) const { fetchBlock(cellsAround(c)); }
  /// ... or gatherLayer().
  void fetchLayer(const CellCoordinates& c, std::size_t axis, int direction) const {
    fetchBlock(layerAt(c, axis, direction));
  }

  std::size_t bytes() const {
    std::size_t bytes = cells_.capacity() * sizeof(Cell) + next_.capacity() * sizeof(Slot);
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

  Block<3> cellsAround(const CellCoordinates& c) const {
    return {neighbours(0, c[0]).cell, neighbours(1, c[1]).cell, neighbours(2, c[2])};
  }

  Block<1> layerAt(const CellCoordinates& c, std::size_t axis, int direction) const {
    // Not by a branch on the axis, which cannot be foretold.
    constexpr std::array<std::uint8_t, 3> kAlong = {1, 0, 0}, kAcross = {2, 2, 1};
    const std::size_t along = kAlong[axis], across = kAcross[axis];
    const auto side = static_cast<unsigned>(1 + direction);
    return {neighbours(along, c[along]).cell,
            {neighbours(axis, c[axis]).cell[side]},
            neighbours(across, c[across])};
  }

  template <std::size_t kRows>
  void fetchBlock(const Block<kRows>& block) const {
    const Cell* const cells = cells_.data();
    block.forEach(
        [cells](std::size_t row, std::size_t column) { fetchAhead(cells + row + column); });
  }

  template <std::size_t kRows>
  void gatherBlock(const Block<kRows>& block, Candidates& candidates) const {
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

  std::array<std::int32_t, 3> mask_{};  // of coordinates on open axes; all ones elsewhere
  std::array<std::vector<AxisNeighbours>, 3> neighbours_;
  HugePageVector<Cell> cells_;
  std::vector<Slot> next_;  // in a cell's chain
};

/// Cells are wider than the balls by this, more than rounding ever moves a ball out of its cell.
constexpr double kCellMargin = 1 + 1e-9;

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

/// More are never laid out.
constexpr std::size_t kMostLevels = 32;

/// What is to be known to cut a level.
template <class Real>
struct LevelPlan {
  int depth = 0;           ///< times the coarsest edges are halved, for the cells of members
  int home_depth = 0;      ///< the same for homes and guests
  Real largest = 0;        ///< m, radius of the largest balls
  Real largest_guest = 0;  ///< m, of the largest balls of finer levels
};

/// All levels, and the geometry they share.
template <class Real>
class CellGrid {
 public:
  CellGrid() = default;

  /// @param plans  of the populated levels, coarsest first, at least one; in the finest, members'
  ///               cells are homes
  CellGrid(const std::array<GridAxis<Real>, 3>& axes, const std::vector<LevelPlan<Real>>& plans)
      : axes_(axes), plans_(plans), finest_(plans.size() - 1) {
    const std::array<bool, 3> periodic = {axes[0].periodic, axes[1].periodic, axes[2].periodic};
    const std::array<bool, 3> open = {axes[0].open(), axes[1].open(), axes[2].open()};
    for (const LevelPlan<Real>& plan : plans_) {
      std::array<std::uint32_t, 3> counts{};
      for (std::size_t k = 0; k < 3; ++k) counts[k] = cells(k, plan.depth);
      levels_.emplace_back(counts, periodic, open);
      if (levels_.size() <= finest_) guests_.push_back(guestCells(plan));
      addLattice(plan);
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
  std::size_t finestLevel() const { return finest_; }

  /// Edge of a cell, m.
  Real edge(std::size_t axis, std::size_t level) const {
    using std::ldexp;
    return ldexp(axes_[axis].edge, -plans_[level].depth);
  }

  /// Depth of the homes of a level's members.
  int homeDepth(std::size_t level) const { return plans_[level].home_depth; }

  /// Radius of the largest balls that a level takes, m.
  Real largestRadius(std::size_t level) const { return plans_[level].largest; }

  /// Number of homes from end to end of a bounded axis.
  std::int32_t count(std::size_t axis, std::size_t level) const {
    return static_cast<std::int32_t>(axes_[axis].cells << plans_[level].home_depth);
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

  /// Cells once round a periodic axis, of cells whose edges are halved `depth` times; on others so
  /// many that the way round is never the shorter.
  std::int32_t pointsRound(std::size_t axis, int depth) const {
    if (!axes_[axis].periodic) return std::numeric_limits<std::int32_t>::max();
    return static_cast<std::int32_t>(axes_[axis].cells << depth);
  }

  void resize(std::size_t slots) {
    for (CellLevel& level : levels_) level.resize(slots);
    for (GuestCells& guests : guests_) guests.resize(slots);
  }

  /// Takes all balls out.
  void clear() {
    for (CellLevel& level : levels_) level.clear();
    for (GuestCells& guests : guests_) guests.clear();
  }

  /// Puts a ball into its level and, as a guest, into all coarser ones.
  void link(Slot slot, const CellCoordinates& home, std::size_t level) {
    levels_[level].link(slot, levels_[level].cellIndex(memberCell(home, level)));
    if (level < finest_) guests_[level].addHost(slot, home);
    for (std::size_t m = 0; m < level; ++m) {
      guests_[m].link(slot, guests_[m].cellIndex(guestCell(home, level, m)));
    }
  }

  void unlink(Slot slot, const CellCoordinates& home, std::size_t level) {
    levels_[level].unlink(slot, levels_[level].cellIndex(memberCell(home, level)));
    if (level < finest_) guests_[level].removeHost(slot, home);
    for (std::size_t m = 0; m < level; ++m) {
      guests_[m].unlink(slot, guests_[m].cellIndex(guestCell(home, level, m)));
    }
  }

  /// Moves a ball to the adjacent home along `axis` towards `direction` (-1 or +1).
  void move(Slot slot, const CellCoordinates& from, const CellCoordinates& to, std::size_t axis,
            int direction, std::size_t level) {
    if (level < finest_) {
      guests_[level].moveHost(slot, from, to, axis, direction);
      const CellCoordinates before = memberCell(from, level);
      const CellCoordinates after = memberCell(to, level);
      if (after != before) moveMember(slot, before, after, axis, level);
    } else {
      moveMember(slot, from, to, axis, level);
    }
    for (std::size_t m = 0; m < level; ++m) {
      if (!crossesGuestCell(to, axis, direction, level, m)) continue;
      guests_[m].unlink(slot, guests_[m].cellIndex(guestCell(from, level, m)));
      guests_[m].link(slot, guests_[m].cellIndex(guestCell(to, level, m)));
    }
  }

  /// Finds all balls that can touch one that is at home here, on `level`, before anyone crosses,
  /// itself included.
  void gatherNear(const CellCoordinates& home, std::size_t level, Candidates& candidates) const {
    candidates.count = 0;
    if (level < finest_) {
      levels_[level].gather(memberCell(home, level), candidates);
      guests_[level].gather(home, candidates);
    } else {
      levels_[level].gather(home, candidates);
    }
    for (std::size_t m = 0; m < level; ++m) gatherHosts(guestCell(home, level, m), m, candidates);
    candidates.close();
  }

  /// The same, but only those that came near when the ball crossed into this home along `axis`
  /// towards `direction` (-1 or +1), perhaps with some that were so before.
  void gatherNew(const CellCoordinates& home, std::size_t level, std::size_t axis, int direction,
                 Candidates& candidates) const {
    candidates.count = 0;
    if (level < finest_) {
      gatherNewToHost(home, level, axis, direction, candidates);
    } else {
      levels_[level].gatherLayer(home, axis, direction, candidates);
    }
    for (std::size_t m = 0; m < level; ++m) {
      if (!crossesGuestCell(home, axis, direction, level, m)) continue;
      const CellCoordinates cell = guestCell(home, level, m);
      if (guests_[m].halvings() > 0) {
        gatherHosts(cell, m, candidates);
      } else {
        levels_[m].gatherLayer(cell, axis, direction, candidates);
      }
    }
    candidates.close();
  }

  /// Finds, of its own level alone, the balls that will be new to one that crosses next.
  void foreseeNew(const CellCoordinates& before, std::size_t level, std::size_t axis, int direction,
                  Candidates& candidates) const {
    candidates.count = 0;
    const CellCoordinates home = behind(before, level, axis, direction);
    if (level < finest_) {
      gatherNewToHost(home, level, axis, direction, candidates);
    } else {
      levels_[level].gatherLayer(home, axis, direction, candidates);
    }
  }

  /// Fetches the cells from memory that gatherNear() looks into, of its own level alone, ...
  void fetchNear(const CellCoordinates& home, std::size_t level) const {
    levels_[level].fetchAround(memberCell(home, level));
  }
  /// ... or move() and gatherNew(), where a ball crosses next.
  void fetchNew(const CellCoordinates& before, std::size_t level, std::size_t axis,
                int direction) const {
    const CellCoordinates cell = memberCell(behind(before, level, axis, direction), level);
    levels_[level].fetch(memberCell(before, level));
    levels_[level].fetch(cell);
    levels_[level].fetchLayer(cell, axis, direction);
  }

  std::size_t bytes() const {
    std::size_t bytes = 0;
    for (const CellLevel& level : levels_) bytes += level.bytes();
    for (const GuestCells& guests : guests_) bytes += guests.bytes();
    return bytes;
  }

 private:
  // From end to end of an axis, of cells whose edges are halved `depth` times.
  std::uint32_t cells(std::size_t axis, int depth) const {
    return axes_[axis].cells << (axes_[axis].flat ? 0 : depth);
  }

  GuestCells guestCells(const LevelPlan<Real>& plan) const {
    const Lattice<Real> homes = lattice(plan.home_depth);
    std::array<GuestCells::Axis, 3> cut;
    for (std::size_t k = 0; k < 3; ++k) {
      cut[k] = {static_cast<std::int32_t>(cells(k, plan.home_depth)), axes_[k].periodic,
                axes_[k].open(), double(homes.spacing[k])};
    }
    return {cut, double((plan.largest + plan.largest_guest) * Real(kCellMargin)),
            plan.home_depth - plan.depth};
  }

  // Homes; no ball leaves them through a wall.
  void addLattice(const LevelPlan<Real>& plan) {
    Lattice<Real> homes = lattice(plan.home_depth);
    for (std::size_t k = 0; k < 3; ++k) {
      homes.has_ends |= axes_[k].lower_wall || axes_[k].upper_wall;
      if (axes_[k].lower_wall) homes.end[k][0] = 0;
      if (axes_[k].upper_wall) {
        homes.end[k][1] = static_cast<std::int32_t>(cells(k, plan.home_depth)) - 1;
      }
    }
    lattices_.push_back(homes);
  }

  CellCoordinates memberCell(const CellCoordinates& home, std::size_t level) const {
    return coarserCell(home, plans_[level].home_depth - plans_[level].depth);
  }

  // The cell of a coarser level's guests.
  CellCoordinates guestCell(const CellCoordinates& home, std::size_t level,
                            std::size_t coarse) const {
    return coarserCell(home, plans_[level].home_depth - plans_[coarse].home_depth);
  }

  // Whether a ball that has crossed into a home is thereby in another cell of a coarser level's
  // guests.
  bool crossesGuestCell(const CellCoordinates& home, std::size_t axis, int direction,
                        std::size_t level, std::size_t coarse) const {
    const int halvings = plans_[level].home_depth - plans_[coarse].home_depth;
    return (home[axis] - direction) >> halvings != home[axis] >> halvings;
  }

  void moveMember(Slot slot, const CellCoordinates& from, const CellCoordinates& to,
                  std::size_t axis, std::size_t level) {
    CellLevel& own = levels_[level];
    const std::uint32_t before = own.cellIndex(from);
    own.unlink(slot, before);
    own.link(slot, before - own.neighbours(axis, from[axis]).cell[1] +
                       own.neighbours(axis, to[axis]).cell[1]);
  }

  // The members of a coarser level that a guest of it can touch.
  void gatherHosts(const CellCoordinates& cell, std::size_t coarse, Candidates& candidates) const {
    const GuestCells& guests = guests_[coarse];
    if (guests.halvings() > 0) {
      const Hosts hosts = guests.hostsAt(guests.cellIndex(cell));
      if (hosts.none()) return;
      if (hosts.isSingle()) return candidates.add(hosts.single());
    }
    levels_[coarse].gather(coarserCell(cell, guests.halvings()), candidates);
  }

  void gatherNewToHost(const CellCoordinates& home, std::size_t level, std::size_t axis,
                       int direction, Candidates& candidates) const {
    const GuestCells& guests = guests_[level];
    guests.gatherNew(home, axis, direction, candidates);
    const int halvings = guests.halvings();
    if ((home[axis] - direction) >> halvings == home[axis] >> halvings) return;
    levels_[level].gatherLayer(coarserCell(home, halvings), axis, direction, candidates);
  }

  // The next home, in the periodic box.
  CellCoordinates behind(CellCoordinates c, std::size_t level, std::size_t axis,
                         int direction) const {
    c[axis] += direction;
    if (!axes_[axis].periodic) return c;
    const std::int32_t homes = count(axis, level);
    c[axis] = c[axis] < 0 ? homes - 1 : c[axis] == homes ? 0 : c[axis];
    return c;
  }

  std::array<GridAxis<Real>, 3> axes_;
  std::vector<LevelPlan<Real>> plans_;  // by level, coarsest first, and so below
  std::size_t finest_ = 0;              // level
  std::vector<CellLevel> levels_;
  std::vector<GuestCells> guests_;       // of all levels but the finest
  std::vector<Lattice<Real>> lattices_;  // of homes
};

}  // namespace ball_sim::core
