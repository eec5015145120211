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
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"
#include "event_driven/event_queue.hpp"
#include "event_driven/huge_page_vector.hpp"

namespace ball_sim::core {

/// Coordinates of a cell along the axes, in the cells of one level.
using CellCoordinates = std::array<std::int32_t, 3>;

/// The place of a cell along Morton's space-filling curve (1966), which keeps near what is near.
/// @param shift  the level's cells are 2^shift finest cells wide
inline std::uint64_t mortonKey(const CellCoordinates& c, int shift) {
  std::uint64_t key = 0;
  for (int bit = 0; bit < 21; ++bit) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto coordinate = static_cast<std::uint32_t>(c[static_cast<std::size_t>(axis)])
                              << shift;
      key |= std::uint64_t{(coordinate >> bit) & 1} << (3 * bit + axis);
    }
  }
  return key;
}

/// Images of a periodic box, as a number of three base-3 digits; kHomeImage: not shifted at all.
using Image = std::uint32_t;
constexpr Image kHomeImage = 13;

/// The adjacent cells of one cell along one axis: lower, itself, upper.
struct AxisNeighbours {
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  std::array<std::uint32_t, 3> cell = {kNone, kNone, kNone};  ///< part of the cell's index
  std::array<Image, 3> image = {0, 0, 0};                     ///< digit of the image, in place
  std::uint8_t begin = 1;                                     ///< first that is not kNone
  std::uint8_t end = 2;                                       ///< behind the last
  bool wraps = false;                                         ///< some image is not at home
  bool inside = false;  ///< the neighbours lie where they lie for most cells: no edge is near
};

/// The balls found near a ball, with the image each was found in.
struct Candidates {
  std::vector<Slot> slots;
  std::vector<Image> images;
  std::size_t count = 0;
  bool wraps = false;  ///< some image is not kHomeImage

  void clear() {
    count = 0;
    wraps = false;
  }

  /// From here on images differ; those found so far are at home.
  void wrap() {
    if (!wraps) std::fill_n(images.begin(), count, kHomeImage);
    wraps = true;
  }

  /// Makes room for `more` beyond `count`.
  void reserve(std::size_t more) {
    if (slots.size() >= count + more) return;
    slots.resize(2 * (count + more));
    images.resize(2 * (count + more));
  }

  void add(Slot slot, Image image) {
    reserve(1);
    slots[count] = slot;
    images[count++] = image;
  }
};

/// The balls in one cell: the first few beside each other, so that they are copied without a
/// branch on how many there are.
struct alignas(16) Cell {
  static constexpr std::uint32_t kInPlace = 3;

  /// Beyond three balls the last of these is the head of a chain that holds the third and later.
  std::array<Slot, kInPlace> slots = {kNoSlot, kNoSlot, kNoSlot};
  std::uint32_t count = 0;
};

/// Some cells around a cell, as indices or as offsets to an index, and the images they stand for.
struct CellList {
  std::array<std::uint32_t, 27> cell{};
  std::array<Image, 27> image{};
  std::size_t count = 0;

  void add(std::uint32_t c, Image i) {
    cell[count] = c;
    image[count++] = i;
  }
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
    Image digit = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      mask_[axis] = open[axis] ? static_cast<std::int32_t>(counts[axis]) - 1 : -1;
      neighbours_[axis] = axisNeighbours(counts[axis], periodic[axis], open[axis], stride, digit);
      stride *= counts[axis];
      digit *= 3;
    }
    cells_.resize(stride);
    listOffsets(counts, periodic);
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

  void link(Slot slot, std::uint32_t index) {
    Cell& cell = cells_[index];
    if (cell.count < Cell::kInPlace) {
      cell.slots[cell.count] = slot;
      next_[slot] = kNoSlot;
    } else {
      next_[slot] = cell.slots[2];
      cell.slots[2] = slot;
    }
    ++cell.count;
  }

  void unlink(Slot slot, std::uint32_t index) {
    Cell& cell = cells_[index];
    const std::uint32_t last = std::min(cell.count, Cell::kInPlace) - 1;
    std::uint32_t i = 0;
    while (i < 2 && cell.slots[i] != slot) ++i;
    if (i < 2) {
      cell.slots[i] = cell.slots[last];  // the gap takes the last, or the chain's head
      dropLast(cell, last);
    } else {
      Slot* at = &cell.slots[2];
      while (*at != slot) at = &next_[*at];
      *at = next_[slot];
    }
    --cell.count;
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

  void prefetchAround(const CellCoordinates& c) const {
    const AxisNeighbours& x = neighbours(0, c[0]);
    const AxisNeighbours& y = neighbours(1, c[1]);
    const AxisNeighbours& z = neighbours(2, c[2]);
    for (std::size_t k = z.begin; k < z.end; ++k) {
      for (std::size_t j = y.begin; j < y.end; ++j) {
        __builtin_prefetch(&cells_[z.cell[k] + y.cell[j] + x.cell[1]]);
      }
    }
  }

  /// Adds the members of the 27 cells around `c`, or of the layer of them at `direction` (0 lower,
  /// 2 upper) of `axis`; and the guests there if `with_guests`.
  void gather(const CellCoordinates& c, std::size_t axis, std::size_t direction, bool with_guests,
              Candidates& candidates) const {
    const AxisNeighbours& x = neighbours(0, c[0]);
    const AxisNeighbours& y = neighbours(1, c[1]);
    const AxisNeighbours& z = neighbours(2, c[2]);
    candidates.reserve(kMostInPlace);
    const bool around = axis == kAllAround;
    if (x.inside && y.inside && z.inside) {
      const std::uint32_t middle = x.cell[1] + y.cell[1] + z.cell[1];
      const CellList& offsets = around ? around_ : layers_[2 * axis + direction / 2];
      if (candidates.wraps) {
        gatherCells<true>(middle, offsets, offsets.count, candidates);
      } else if (offsets.count == 27) {  // the usual case, unrolled
        gatherCells<false>(middle, offsets, 27, candidates);
      } else {
        gatherCells<false>(middle, offsets, offsets.count, candidates);
      }
      if (with_guests) gatherGuests(middle, offsets, candidates);
      return;
    }
    const CellList list = listAtEdge({&x, &y, &z}, axis, direction);
    if (x.wraps || y.wraps || z.wraps) candidates.wrap();
    if (candidates.wraps) {
      gatherCells<true>(0, list, list.count, candidates);
    } else {
      gatherCells<false>(0, list, list.count, candidates);
    }
    if (with_guests) gatherGuests(0, list, candidates);
  }

  static constexpr std::size_t kAllAround = 3;  // no axis

  // What 27 cells are copied to, their counts included.
  static constexpr std::size_t kMostInPlace = 27 * sizeof(Cell) / sizeof(Slot);

  std::size_t bytes() const {
    std::size_t bytes =
        cells_.capacity() * sizeof(Cell) +
        (guests_.capacity() + next_.capacity() + previous_.capacity()) * sizeof(Slot);
    for (const auto& axis : neighbours_) bytes += axis.capacity() * sizeof(AxisNeighbours);
    return bytes;
  }

 private:
  // Where the neighbours of a cell lie that no edge is near, as offsets.
  void listOffsets(const std::array<std::uint32_t, 3>& counts,
                   const std::array<bool, 3>& periodic) {
    const auto steps = [&](std::size_t axis) {
      return counts[axis] == 1 && !periodic[axis] ? std::vector<int>{0}
                                                  : std::vector<int>{-1, 0, 1};
    };
    const auto width = static_cast<std::int64_t>(counts[0]);
    const auto area = width * static_cast<std::int64_t>(counts[1]);
    for (const int z : steps(2)) {
      for (const int y : steps(1)) {
        for (const int x : steps(0)) {
          const auto offset = static_cast<std::uint32_t>(x + width * y + area * z);
          around_.add(offset, kHomeImage);
          const std::array<int, 3> step = {x, y, z};
          for (std::size_t axis = 0; axis < 3; ++axis) {
            if (step[axis] < 0) layers_[2 * axis].add(offset, kHomeImage);
            if (step[axis] > 0) layers_[2 * axis + 1].add(offset, kHomeImage);
          }
        }
      }
    }
  }

  static CellList listAtEdge(const std::array<const AxisNeighbours*, 3>& near, std::size_t axis,
                             std::size_t direction) {
    std::array<std::size_t, 3> from{};
    std::array<std::size_t, 3> to{};
    CellList list;
    for (std::size_t k = 0; k < 3; ++k) {
      from[k] = k == axis ? direction : near[k]->begin;
      to[k] = k == axis ? direction + 1 : near[k]->end;
      if (k == axis && near[k]->cell[direction] == AxisNeighbours::kNone) return list;
    }
    for (std::size_t k = from[2]; k < to[2]; ++k) {
      for (std::size_t j = from[1]; j < to[1]; ++j) {
        const std::uint32_t row = near[2]->cell[k] + near[1]->cell[j];
        const Image row_image = near[2]->image[k] + near[1]->image[j];
        for (std::size_t i = from[0]; i < to[0]; ++i) {
          list.add(row + near[0]->cell[i], row_image + near[0]->image[i]);
        }
      }
    }
    return list;
  }

  template <bool kWraps>
  inline __attribute__((always_inline)) void gatherCells(std::uint32_t middle, const CellList& list,
                                                         std::size_t number,
                                                         Candidates& candidates) const {
    Slot* slots = candidates.slots.data();
    Image* images = candidates.images.data();
    const Cell* cells = cells_.data();
    std::size_t count = candidates.count;
    for (std::size_t i = 0; i < number; ++i) {
      // Offsets may be negative: the sum is meant modulo 2^32.
      const Cell& cell = cells[static_cast<std::uint32_t>(middle + list.cell[i])];
      // One copy of the whole cell; what is too much is overwritten by the next.
      std::memcpy(slots + count, &cell, sizeof(Cell));
      if constexpr (kWraps) {
        const Image image = list.image[i];
        const std::array<Image, 4> same = {image, image, image, image};
        std::memcpy(images + count, &same, sizeof(same));
      }
      if (__builtin_expect(cell.count <= Cell::kInPlace, 1)) {
        count += cell.count;
      } else {
        candidates.count = count + Cell::kInPlace;
        gatherChain(cell, list.image[i], candidates);
        slots = candidates.slots.data();
        images = candidates.images.data();
        count = candidates.count;
      }
    }
    candidates.count = count;
  }

  void gatherGuests(std::uint32_t middle, const CellList& list, Candidates& candidates) const {
    for (std::size_t i = 0; i < list.count; ++i) {
      Slot s = guests_[static_cast<std::uint32_t>(middle + list.cell[i])];
      for (; s != kNoSlot; s = next_[s]) candidates.add(s, list.image[i]);
    }
  }

  void gatherChain(const Cell& cell, Image image, Candidates& candidates) const {
    for (Slot s = next_[cell.slots[2]]; s != kNoSlot; s = next_[s]) candidates.add(s, image);
    candidates.reserve(kMostInPlace);
  }

  void dropLast(Cell& cell, std::uint32_t last) {
    cell.slots[last] = last == 2 ? next_[cell.slots[2]] : kNoSlot;
  }

  static std::vector<AxisNeighbours> axisNeighbours(std::uint32_t count, bool periodic, bool open,
                                                    std::uint32_t stride, Image digit) {
    std::vector<AxisNeighbours> table(count);
    for (std::uint32_t c = 0; c < count; ++c) {
      AxisNeighbours& near = table[c];
      near.cell[1] = c * stride;
      near.image = {digit, digit, digit};
      // On an open axis of one or two cells the neighbours are cells already listed.
      const bool wraps = periodic || (open && count > 2);
      if (c > 0 || wraps) near.cell[0] = (c > 0 ? c - 1 : count - 1) * stride;
      if (c + 1 < count || wraps) near.cell[2] = (c + 1 < count ? c + 1 : 0) * stride;
      near.begin = near.cell[0] == AxisNeighbours::kNone ? 1 : 0;
      near.end = near.cell[2] == AxisNeighbours::kNone ? 2 : 3;
      if (periodic && c == 0) near.image[0] = 0;
      if (periodic && c + 1 == count) near.image[2] = 2 * digit;
      near.wraps = periodic && (c == 0 || c + 1 == count);
      near.inside = (c > 0 && c + 1 < count) || (count == 1 && !periodic);
    }
    return table;
  }

  int depth_;
  std::array<std::int32_t, 3> mask_{};  // of coordinates on open axes; all ones elsewhere
  std::array<std::vector<AxisNeighbours>, 3> neighbours_;
  HugePageVector<Cell> cells_;      // members
  CellList around_;                 // offsets of the neighbours of a cell inside
  std::array<CellList, 6> layers_;  // and of those on each side: lower x, upper x, lower y, ...
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
    for (const CellLevel& level : levels_) {
      using std::ldexp;
      edges_.push_back({ldexp(axes[0].edge, -level.depth()), ldexp(axes[1].edge, -level.depth()),
                        ldexp(axes[2].edge, -level.depth())});
    }
  }

  const GridAxis<Real>& axis(std::size_t k) const { return axes_[k]; }
  std::vector<CellLevel>& levels() { return levels_; }
  const std::vector<CellLevel>& levels() const { return levels_; }

  /// Edge of a cell, m.
  Real edge(std::size_t axis, std::size_t level) const { return edges_[level][axis]; }

  /// Number of cells from end to end of a bounded axis.
  std::int32_t count(std::size_t axis, std::size_t level) const {
    return static_cast<std::int32_t>(axes_[axis].cells << levels_[level].depth());
  }

  /// Whether a box face bounds the cells at a coordinate, towards `direction` (-1 or +1).
  bool isWall(std::size_t axis, std::size_t level, std::int32_t coordinate, int direction) const {
    if (direction < 0) return axes_[axis].lower_wall && coordinate == 0;
    return axes_[axis].upper_wall && coordinate == count(axis, level) - 1;
  }

  CellCoordinates coordinatesOf(const VectorOf<Real>& x, std::size_t level) const {
    using std::floor;
    CellCoordinates c{};
    for (std::size_t k = 0; k < 3; ++k) {
      if (axes_[k].flat) continue;
      const Real cell = floor((x[static_cast<int>(k)] - axes_[k].origin) / edge(k, level));
      c[k] = static_cast<std::int32_t>(cell);
      if (axes_[k].lower_wall || axes_[k].periodic) c[k] = std::max(c[k], 0);
      if (axes_[k].upper_wall || axes_[k].periodic) c[k] = std::min(c[k], count(k, level) - 1);
    }
    return c;
  }

  /// The same cell of `level` in the coordinates of a coarser one.
  CellCoordinates coarser(const CellCoordinates& c, std::size_t level, std::size_t coarse) const {
    const int shift = levels_[level].depth() - levels_[coarse].depth();
    return {c[0] >> shift, c[1] >> shift, c[2] >> shift};
  }

  void resize(std::size_t slots) {
    for (CellLevel& level : levels_) level.resize(slots);
  }

  /// Puts a ball into its level and, as a guest, into all coarser ones.
  void link(Slot slot, const CellCoordinates& coordinates, std::size_t level) {
    levels_[level].link(slot, levels_[level].cellIndex(coordinates));
    for (std::size_t m = 0; m < level; ++m) {
      levels_[m].linkGuest(slot, levels_[m].cellIndex(coarser(coordinates, level, m)));
    }
  }

  void unlink(Slot slot, const CellCoordinates& coordinates, std::size_t level) {
    levels_[level].unlink(slot, levels_[level].cellIndex(coordinates));
    for (std::size_t m = 0; m < level; ++m) {
      levels_[m].unlinkGuest(slot, levels_[m].cellIndex(coarser(coordinates, level, m)));
    }
  }

  /// Moves a ball to an adjacent cell of its level.
  void move(Slot slot, const CellCoordinates& from, const CellCoordinates& to, std::size_t level) {
    levels_[level].unlink(slot, levels_[level].cellIndex(from));
    levels_[level].link(slot, levels_[level].cellIndex(to));
    for (std::size_t m = 0; m < level; ++m) {
      const std::uint32_t before = levels_[m].cellIndex(coarser(from, level, m));
      const std::uint32_t after = levels_[m].cellIndex(coarser(to, level, m));
      if (before == after) continue;
      levels_[m].unlinkGuest(slot, before);
      levels_[m].linkGuest(slot, after);
    }
  }

  /// Finds all balls that can touch one at these coordinates of `level` before anyone crosses,
  /// itself included.
  void gatherNear(const CellCoordinates& coordinates, std::size_t level,
                  Candidates& candidates) const {
    candidates.clear();
    for (std::size_t m = 0; m <= level; ++m) {
      gatherAt(m, coarser(coordinates, level, m), CellLevel::kAllAround, 0, m == level, candidates);
    }
  }

  /// The same, but only the layer of cells that came near by a crossing along `axis` towards
  /// `direction` (0 lower, 2 upper), on the levels where cells were crossed at all.
  /// @param unwrapped  the coordinates after the crossing, `after` before it was put back into the
  ///                   periodic box
  void gatherNewLayer(const CellCoordinates& before, const CellCoordinates& unwrapped,
                      const CellCoordinates& after, std::size_t level, std::size_t axis,
                      std::size_t direction, Candidates& candidates) const {
    candidates.clear();
    for (std::size_t m = 0; m <= level; ++m) {
      if (coarser(unwrapped, level, m)[axis] == coarser(before, level, m)[axis]) continue;
      gatherAt(m, coarser(after, level, m), axis, direction, m == level, candidates);
    }
  }

  /// Fetches the cells around a ball from memory.
  void prefetchNear(const CellCoordinates& c, std::size_t level) const {
    levels_[level].prefetchAround(c);
  }

  std::size_t bytes() const {
    std::size_t bytes = 0;
    for (const CellLevel& level : levels_) bytes += level.bytes();
    return bytes;
  }

 private:
  void gatherAt(std::size_t level, const CellCoordinates& c, std::size_t axis,
                std::size_t direction, bool own, Candidates& candidates) const {
    levels_[level].gather(c, axis, direction, own && levels_[level].hasGuests(), candidates);
  }

  std::array<GridAxis<Real>, 3> axes_;
  std::vector<CellLevel> levels_;           // coarsest first
  std::vector<std::array<Real, 3>> edges_;  // m, by level and axis
};

}  // namespace ball_sim::core
