// Finds overlaps among many balls of very different sizes.
#include "ball_sim/overlap_index.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "ball_sim/ball_check.hpp"

namespace ball_sim::core {
namespace {

// Cells further out than this share the outermost: places there are coarser than a cell anyway.
constexpr double kFarthestCell = 4e18;

std::int64_t cellIndex(double coordinate, double width) {
  const double cell = std::floor(coordinate / width);
  return static_cast<std::int64_t>(std::min(std::max(cell, -kFarthestCell), kFarthestCell));
}

// Spreads all bits. Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators"
// (2014), the finaliser of SplitMix64.
std::uint64_t mix(std::uint64_t bits) {
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111eb;
  return bits ^ (bits >> 31);
}

}  // namespace

OverlapIndex::OverlapIndex(const Surroundings& surroundings) : surroundings_(surroundings) {}

OverlapIndex::Level& OverlapIndex::levelOf(double radius) {
  int exponent = 0;
  std::frexp(2 * radius, &exponent);  // 2 r < 2^exponent <= 4 r
  for (Level& level : levels_) {
    if (level.exponent == exponent) return level;
  }
  Level level;
  level.exponent = exponent;
  level.width.fill(std::ldexp(1.0, exponent));
  for (std::size_t axis = 0; surroundings_.periodic && axis < 3; ++axis) {
    if (axis == 2 && surroundings_.planar()) break;
    const auto i = static_cast<Eigen::Index>(axis);
    const double length = surroundings_.box.max[i] - surroundings_.box.min[i];
    const double cells = std::min(std::max(1.0, std::floor(length / level.width[axis])), 1e9);
    level.cells[axis] = static_cast<std::int64_t>(cells);
    level.width[axis] = length / cells;
  }
  level.slots.resize(16);
  levels_.push_back(std::move(level));
  return levels_.back();
}

OverlapIndex::Cell OverlapIndex::cellAt(const Level& level, const Vector3& position) const {
  Cell cell;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    if (level.cells[axis] == 0) {
      cell[axis] = cellIndex(position[i], level.width[axis]);
    } else {
      const double from_min = position[i] - surroundings_.box.min[i];
      cell[axis] = std::min(cellIndex(from_min, level.width[axis]), level.cells[axis] - 1);
    }
  }
  return cell;
}

// Neighbours along x lie side by side in memory: most searches run along x.
std::size_t OverlapIndex::slotOf(const Level& level, const Cell& cell) {
  const auto y = static_cast<std::uint64_t>(cell[1]);
  const auto z = static_cast<std::uint64_t>(cell[2]);
  const std::size_t mask = level.slots.size() - 1;
  std::size_t slot =
      (mix(mix(y) + z * 0x9e3779b97f4a7c15) + static_cast<std::uint64_t>(cell[0])) & mask;
  while (level.slots[slot].first != kNone && level.slots[slot].cell != cell) {
    slot = (slot + 1) & mask;
  }
  return slot;
}

void OverlapIndex::grow(Level& level) {
  std::vector<Slot> old(2 * level.slots.size());
  old.swap(level.slots);
  for (const Slot& slot : old) {
    if (slot.first != kNone) level.slots[slotOf(level, slot.cell)] = slot;
  }
}

void OverlapIndex::insert(std::size_t number, const Vector3& position, double radius) {
  Level& level = levelOf(radius);
  assert(level.entries.size() < kNone);
  if (2 * (level.used + 1) > level.slots.size()) grow(level);
  const Vector3 inside = wrapped(position, surroundings_);
  Slot& slot = level.slots[slotOf(level, cellAt(level, inside))];
  if (slot.first == kNone) {
    slot.cell = cellAt(level, inside);
    ++level.used;
  }
  level.entries.push_back({inside, radius, number, slot.first});
  slot.first = static_cast<std::uint32_t>(level.entries.size() - 1);
  level.largest = std::max(level.largest, radius);
}

template <class Visit>
void OverlapIndex::search(const Vector3& position, double radius, Visit visit) const {
  const Vector3 inside = wrapped(position, surroundings_);
  const auto overlaps = [&](const Entry& entry) {
    return overlapping(separation(inside, entry.position, surroundings_), radius + entry.radius);
  };
  for (const Level& level : levels_) {
    const double reach = radius + level.largest;
    Cell first = cellAt(level, inside);
    Cell last = first;
    double count = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      if (axis == 2 && surroundings_.planar()) break;
      const double origin = level.cells[axis] == 0 ? 0 : surroundings_.box.min[i];
      first[axis] = cellIndex(inside[i] - origin - reach, level.width[axis]);
      last[axis] = cellIndex(inside[i] - origin + reach, level.width[axis]);
      if (level.cells[axis] != 0) {  // once around at most
        last[axis] = std::min(last[axis], first[axis] + level.cells[axis] - 1);
      }
      count *= static_cast<double>(last[axis] - first[axis]) + 1;
    }
    if (count > static_cast<double>(level.entries.size())) {
      for (const Entry& entry : level.entries) {
        if (overlaps(entry) && visit(entry)) return;
      }
      continue;
    }
    const auto around = [&level](std::int64_t cell, std::size_t axis) {
      const std::int64_t cells = level.cells[axis];
      return cells == 0 ? cell : ((cell % cells) + cells) % cells;
    };
    Cell cell;
    for (std::int64_t z = first[2]; z <= last[2]; ++z) {
      cell[2] = around(z, 2);
      for (std::int64_t y = first[1]; y <= last[1]; ++y) {
        cell[1] = around(y, 1);
        for (std::int64_t x = first[0]; x <= last[0]; ++x) {
          cell[0] = around(x, 0);
          for (std::uint32_t e = level.slots[slotOf(level, cell)].first; e != kNone;
               e = level.entries[e].next) {
            if (overlaps(level.entries[e]) && visit(level.entries[e])) return;
          }
        }
      }
    }
  }
}

std::optional<std::size_t> OverlapIndex::find(const Vector3& position, double radius) const {
  std::optional<std::size_t> smallest;
  search(position, radius, [&smallest](const Entry& entry) {
    if (!smallest || entry.number < *smallest) smallest = entry.number;
    return false;
  });
  return smallest;
}

void OverlapIndex::findAll(const Vector3& position, double radius,
                           std::vector<std::size_t>& numbers) const {
  numbers.clear();
  search(position, radius, [&numbers](const Entry& entry) {
    numbers.push_back(entry.number);
    return false;
  });
}

bool OverlapIndex::overlapsAny(const Vector3& position, double radius) const {
  bool any = false;
  search(position, radius, [&any](const Entry&) { return any = true; });
  return any;
}

std::vector<std::optional<std::size_t>> overlapsAmong(const std::vector<Ball>& balls,
                                                      const std::vector<bool>& checked,
                                                      const Surroundings& surroundings) {
  std::vector<std::size_t> order(balls.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return balls[a].radius > balls[b].radius; });
  OverlapIndex index(surroundings);
  std::vector<std::optional<std::size_t>> found(balls.size());
  for (const std::size_t i : order) {
    if (!checked[i]) continue;
    found[i] = index.find(balls[i].position, balls[i].radius);
    index.insert(i, balls[i].position, balls[i].radius);
  }
  return found;
}

}  // namespace ball_sim::core
