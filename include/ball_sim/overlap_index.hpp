// Finds overlaps among many balls of very different sizes: a hash grid with one level a size.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// A set of balls to search for overlaps.
///
/// Each ball lies in one cell of the level whose cells are one to two of its diameters wide; a
/// search looks, level by level, at the cells within reach. Insert large balls before small ones:
/// then each search meets few cells, whatever the ratio of sizes. A large ball searched for among
/// many small ones costs a pass over those at worst.
class OverlapIndex {
 public:
  explicit OverlapIndex(const Surroundings& surroundings);

  /// Adds a ball, whether it overlaps others or not.
  /// @param number    what find() calls it
  /// @param position  m; in a periodic box anywhere
  /// @param radius    m, > 0
  void insert(std::size_t number, const Vector3& position, double radius);

  /// The smallest number of a ball that one at `position` with `radius` would overlap; touching
  /// to kTouchSlack of the sum of radii is no overlap.
  std::optional<std::size_t> find(const Vector3& position, double radius) const;

  /// The numbers of all balls that one at `position` with `radius` would overlap, in no order.
  /// @param numbers  overwritten
  void findAll(const Vector3& position, double radius, std::vector<std::size_t>& numbers) const;

  /// The same question, yes or no: quicker.
  bool overlapsAny(const Vector3& position, double radius) const;

 private:
  using Cell = std::array<std::int64_t, 3>;

  static constexpr std::uint32_t kNone = 0xffffffff;

  struct Entry {
    Vector3 position;  // m
    double radius;     // m
    std::size_t number;
    std::uint32_t next;  // in the same cell
  };
  struct Slot {
    Cell cell = {0, 0, 0};
    std::uint32_t first = kNone;  // kNone: free
  };
  struct Level {
    int exponent = 0;                               // cells are at least 2^exponent m wide
    double largest = 0;                             // radius, m
    std::array<double, 3> width = {0, 0, 0};        // m
    std::array<std::int64_t, 3> cells = {0, 0, 0};  // around a periodic axis; 0: not periodic
    std::vector<Entry> entries;
    std::vector<Slot> slots;  // open addressing, a power of two
    std::size_t used = 0;
  };

  Level& levelOf(double radius);
  Cell cellAt(const Level& level, const Vector3& position) const;
  static std::size_t slotOf(const Level& level, const Cell& cell);
  static void grow(Level& level);

  // Calls visit(entry) for each overlapping ball until it returns true.
  template <class Visit>
  void search(const Vector3& position, double radius, Visit visit) const;

  Surroundings surroundings_;
  std::vector<Level> levels_;
};

/// For each ball another one that it overlaps: of those that are larger, or of its size and before
/// it, the first; nothing when there is none.
/// @param checked  which balls to look at, one entry a ball; the others are as if not there
/// @return indices into `balls`, one entry a ball
std::vector<std::optional<std::size_t>> overlapsAmong(const std::vector<Ball>& balls,
                                                      const std::vector<bool>& checked,
                                                      const Surroundings& surroundings);

}  // namespace ball_sim::core
