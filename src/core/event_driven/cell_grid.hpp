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

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"
#include "event_driven/event_queue.hpp"

namespace ball_sim {

/// Coordinates of a cell along the axes, in the cells of one level.
using CellCoordinates = std::array<std::int32_t, 3>;

/// Images of a periodic box, as a number of three base-3 digits; kHomeImage: not shifted at all.
using Image = std::uint32_t;
constexpr Image kHomeImage = 13;

/// The adjacent cells of one cell along one axis: lower, itself, upper.
struct AxisNeighbours {
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  std::array<std::uint32_t, 3> cell = {kNone, kNone, kNone};  ///< part of the cell's index
  std::array<Image, 3> image = {0, 0, 0};                     ///< digit of the image, in place
};

/// One level of cells, and the lists of balls in them.
class CellLevel {
 public:
  /// @param depth  times the coarsest edges are halved
  /// @param counts cells along each axis
  CellLevel(int depth, const std::array<std::uint32_t, 3>& counts,
            const std::array<bool, 3>& periodic, const std::array<bool, 3>& open)
      : depth_(depth) {
    std::uint32_t stride = 1;
    Image digit = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      mask_[axis] = open[axis] ? static_cast<std::int32_t>(counts[axis]) - 1 : -1;
      neighbours_[axis] = axisNeighbours(counts[axis], periodic[axis], open[axis], stride, digit);
      stride *= counts[axis];
      digit *= 3;
    }
    members_.assign(stride, kNoSlot);
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

  Slot firstMember(std::uint32_t cell) const { return members_[cell]; }
  Slot firstGuest(std::uint32_t cell) const { return guests_[cell]; }
  Slot next(Slot slot) const { return next_[slot]; }
  bool hasGuests() const { return !guests_.empty(); }

  void expectGuests() { guests_.assign(members_.size(), kNoSlot); }
  void resize(std::size_t slots) { next_.resize(slots, kNoSlot); }

  void link(Slot slot, std::uint32_t cell, bool as_guest) {
    Slot& head = (as_guest ? guests_ : members_)[cell];
    next_[slot] = head;
    head = slot;
  }

  void unlink(Slot slot, std::uint32_t cell, bool as_guest) {
    Slot* link = &(as_guest ? guests_ : members_)[cell];
    while (*link != slot) link = &next_[*link];
    *link = next_[slot];
  }

  std::size_t bytes() const {
    std::size_t bytes =
        (members_.capacity() + guests_.capacity() + next_.capacity()) * sizeof(Slot);
    for (const auto& axis : neighbours_) bytes += axis.capacity() * sizeof(AxisNeighbours);
    return bytes;
  }

 private:
  static std::vector<AxisNeighbours> axisNeighbours(std::uint32_t count, bool periodic, bool open,
                                                    std::uint32_t stride, Image digit) {
    std::vector<AxisNeighbours> table(count);
    for (std::uint32_t c = 0; c < count; ++c) {
      AxisNeighbours& near = table[c];
      near.cell[1] = c * stride;
      near.image = {digit, digit, digit};
      const bool wraps = periodic || open;
      // On an open axis of one or two cells the neighbours are cells already listed.
      if (c > 0 || (wraps && (periodic || count > 2))) {
        near.cell[0] = (c > 0 ? c - 1 : count - 1) * stride;
      }
      if (c + 1 < count || (wraps && (periodic || count > 2))) {
        near.cell[2] = (c + 1 < count ? c + 1 : 0) * stride;
      }
      if (periodic && c == 0) near.image[0] = 0;
      if (periodic && c + 1 == count) near.image[2] = 2 * digit;
    }
    return table;
  }

  int depth_;
  std::array<std::int32_t, 3> mask_{};  // of coordinates on open axes; all ones elsewhere
  std::array<std::vector<AxisNeighbours>, 3> neighbours_;
  std::vector<Slot> members_;  // first ball of each cell's list
  std::vector<Slot> guests_;   // the same for balls of finer levels; empty when there are none
  std::vector<Slot> next_;     // a ball is in one list of a level
};

/// How one axis is cut.
template <class Real>
struct GridAxis {
  Real origin = 0;  ///< m, lower end of cell 0
  Real length = 0;  ///< m, of a periodic axis
  bool periodic = false;
  bool flat = false;        ///< all balls share one coordinate: one cell, no crossings
  bool lower_wall = false;  ///< a box face at the lower end of cell 0
  bool upper_wall = false;  ///< a box face at the upper end of the last cell
  std::uint32_t cells = 1;  ///< at depth 0
  Real edge = 1;            ///< m, at depth 0

  bool open() const { return !periodic && !flat && !(lower_wall && upper_wall); }
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
  }

  const GridAxis<Real>& axis(std::size_t k) const { return axes_[k]; }
  std::vector<CellLevel>& levels() { return levels_; }
  const std::vector<CellLevel>& levels() const { return levels_; }

  Real edge(std::size_t axis, int depth) const {
    using std::ldexp;
    return ldexp(axes_[axis].edge, -depth);
  }

  /// Number of cells from end to end of a bounded axis.
  std::int32_t count(std::size_t axis, int depth) const {
    return static_cast<std::int32_t>(axes_[axis].cells << depth);
  }

  CellCoordinates coordinatesOf(const VectorOf<Real>& x, int depth) const {
    using std::floor;
    CellCoordinates c{};
    for (std::size_t k = 0; k < 3; ++k) {
      if (axes_[k].flat) continue;
      const Real cell = floor((x[static_cast<int>(k)] - axes_[k].origin) / edge(k, depth));
      c[k] = static_cast<std::int32_t>(cell);
      if (axes_[k].lower_wall || axes_[k].periodic) c[k] = std::max(c[k], 0);
      if (axes_[k].upper_wall || axes_[k].periodic) c[k] = std::min(c[k], count(k, depth) - 1);
    }
    return c;
  }

  /// The same cell in the coordinates of a coarser level.
  static CellCoordinates coarser(const CellCoordinates& c, int depth, int coarser_depth) {
    const int shift = depth - coarser_depth;
    return {c[0] >> shift, c[1] >> shift, c[2] >> shift};
  }

  void resize(std::size_t slots) {
    for (CellLevel& level : levels_) level.resize(slots);
  }

  /// Puts a ball into its level and, as a guest, into all coarser ones.
  void link(Slot slot, const CellCoordinates& coordinates, std::size_t level) {
    const int depth = levels_[level].depth();
    for (std::size_t m = 0; m <= level; ++m) {
      const auto c = coarser(coordinates, depth, levels_[m].depth());
      levels_[m].link(slot, levels_[m].cellIndex(c), m != level);
    }
  }

  void unlink(Slot slot, const CellCoordinates& coordinates, std::size_t level) {
    const int depth = levels_[level].depth();
    for (std::size_t m = 0; m <= level; ++m) {
      const auto c = coarser(coordinates, depth, levels_[m].depth());
      levels_[m].unlink(slot, levels_[m].cellIndex(c), m != level);
    }
  }

  /// Calls visit(slot, image) for all balls that can touch one at these coordinates of `level`
  /// before anyone crosses, itself included.
  template <class Visit>
  void visitNear(const CellCoordinates& coordinates, std::size_t level, Visit visit) const {
    visitLayer(coordinates, level, -1, 0, visit);
  }

  /// The same, but only the layer of cells that came near by a crossing along `axis` towards
  /// `direction` (0 lower, 2 upper), on the levels where cells were crossed at all.
  template <class Visit>
  void visitNewLayer(const CellCoordinates& before, const CellCoordinates& after, std::size_t level,
                     int axis, std::size_t direction, Visit visit) const {
    const auto k = static_cast<std::size_t>(axis);
    const int depth = levels_[level].depth();
    for (std::size_t m = 0; m <= level; ++m) {
      const int shift = depth - levels_[m].depth();
      if (before[k] >> shift == after[k] >> shift) continue;
      visitCells(levels_[m], coarser(after, depth, levels_[m].depth()), axis, direction, m == level,
                 visit);
    }
  }

  std::size_t bytes() const {
    std::size_t bytes = 0;
    for (const CellLevel& level : levels_) bytes += level.bytes();
    return bytes;
  }

 private:
  template <class Visit>
  void visitLayer(const CellCoordinates& coordinates, std::size_t level, int axis,
                  std::size_t direction, Visit visit) const {
    const int depth = levels_[level].depth();
    for (std::size_t m = 0; m <= level; ++m) {
      visitCells(levels_[m], coarser(coordinates, depth, levels_[m].depth()), axis, direction,
                 m == level, visit);
    }
  }

  // The 27 cells around `c`, or of them only the layer at `direction` of `axis`.
  template <class Visit>
  static void visitCells(const CellLevel& level, const CellCoordinates& c, int axis,
                         std::size_t direction, bool own, Visit visit) {
    const AxisNeighbours& x = level.neighbours(0, c[0]);
    const AxisNeighbours& y = level.neighbours(1, c[1]);
    const AxisNeighbours& z = level.neighbours(2, c[2]);
    const auto from = [&](int k) { return k == axis ? direction : std::size_t{0}; };
    const auto to = [&](int k) { return k == axis ? direction : std::size_t{2}; };
    const bool guests = own && level.hasGuests();
    for (std::size_t k = from(2); k <= to(2); ++k) {
      if (z.cell[k] == AxisNeighbours::kNone) continue;
      for (std::size_t j = from(1); j <= to(1); ++j) {
        if (y.cell[j] == AxisNeighbours::kNone) continue;
        const std::uint32_t row = z.cell[k] + y.cell[j];
        const Image row_image = z.image[k] + y.image[j];
        for (std::size_t i = from(0); i <= to(0); ++i) {
          if (x.cell[i] == AxisNeighbours::kNone) continue;
          const std::uint32_t cell = row + x.cell[i];
          const Image image = row_image + x.image[i];
          for (Slot s = level.firstMember(cell); s != kNoSlot; s = level.next(s)) visit(s, image);
          if (!guests) continue;
          for (Slot s = level.firstGuest(cell); s != kNoSlot; s = level.next(s)) visit(s, image);
        }
      }
    }
  }

  std::array<GridAxis<Real>, 3> axes_;
  std::vector<CellLevel> levels_;  // coarsest first
};

}  // namespace ball_sim
