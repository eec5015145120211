// Who is near whom: by cells where balls fly far between impacts, by neighbour lists where they
// rattle among the same neighbours (see wantsLists()).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"
#include "event_driven/agenda.hpp"
#include "event_driven/cell_grid.hpp"
#include "event_driven/grid_layout.hpp"
#include "event_driven/neighbour_lists.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

/// Balls as PairSearch takes them, until others are asked for.
struct Near {
  const Slot* slots;
  std::size_t count;
};

/// Where a ball is told to be is written to its agenda: the cell, and its level.
template <class Real>
class Neighbourhood {
  using Vec = VectorOf<Real>;

 public:
  /// Cuts space for balls like these. All places and lists are forgotten.
  void layOut(const Surroundings& surroundings, const std::vector<GridBall<Real>>& balls) {
    listed_ = wantsLists(surroundings, balls);
    if (listed_) {
      cutIntoRegions(surroundings, balls);
      listed_ = nearestSuffices();
    }
    if (!listed_) {
      grid_ = layOutGrid<Real>(surroundings, balls, 0);
      largest_ = grid_.largestRadius(0);
      lists_ = {};
    }
    grid_.resize(balls.size());
    if (listed_) lists_.reset(balls.size(), regions_);
  }

  /// Whether lists tell who is near, else the cells.
  bool listed() const { return listed_; }

  /// Whether the nearest image of a ball in a periodic box is the only one in reach.
  bool nearestSuffices() const { return nearestImagesSuffice(grid_); }

  /// Whether a ball of this radius, m, is not too large for the cells.
  bool fits(Real radius) const { return radius <= largest_; }

  void resize(std::size_t slots) {
    grid_.resize(slots);
    if (listed_) lists_.resize(slots);
  }

  /// Puts a ball into its cell.
  /// @param x  m, in the box
  void place(Slot slot, const Vec& x, Real radius, Agenda<Real>& agenda) {
    agenda.level = levelOf(radius);
    const int depth = grid_.homeDepth(agenda.level);
    if (listed_) {
      const CellCoordinates home = grid_.coordinatesOf(x, depth + NeighbourLists::kLatticeDepth);
      lists_.setHome(slot, home);
      agenda.cell = coarserCell(home, NeighbourLists::kLatticeDepth);
    } else {
      agenda.cell = grid_.coordinatesOf(x, depth);
    }
    grid_.link(slot, agenda.cell, agenda.level);
  }

  /// All balls have got other slots.
  /// @param to       by the slots they had, those they have; a permutation
  /// @param agendas  by the slots they have
  void renumber(const std::vector<Slot>& to, const HugePageVector<Agenda<Real>>& agendas) {
    grid_.clear();
    grid_.resize(agendas.size());
    for (Slot slot = 0; slot < agendas.size(); ++slot) {
      grid_.link(slot, agendas[slot].cell, agendas[slot].level);
    }
    if (listed_) lists_.renumber(to, agendas.size());
  }

  /// Takes a ball out of its cell. Lists keep it until it is placed anew or forgotten.
  void lift(Slot slot, const Agenda<Real>& agenda) {
    grid_.unlink(slot, agenda.cell, agenda.level);
  }

  /// Gives balls that were placed their first lists.
  /// @param slots    all that there are
  /// @param agendas  by slot
  void fillLists(const std::vector<Slot>& slots, const HugePageVector<Agenda<Real>>& agendas) {
    if (!listed_) return;
    for (const Slot slot : slots) {
      const Near near = inCellsAround(agendas[slot]);
      lists_.fill(slot, near.slots, near.count);
    }
    lists_.makeRoom();
  }

  /// Gives a ball that was placed a new list, with the others' changed accordingly.
  void renewList(Slot slot, const Agenda<Real>& agenda) {
    if (!listed_) return;
    const Near near = inCellsAround(agenda);
    lists_.renew(slot, near.slots, near.count);
  }
  void forget(Slot slot) {
    if (listed_) lists_.renew(slot, nullptr, 0);
  }

  /// All that a ball can meet before its crossing, perhaps itself among them.
  Near near(Slot slot, const Agenda<Real>& agenda) {
    if (listed_) return {lists_.of(slot), lists_.count(slot)};
    return inCellsAround(agenda);
  }

  /// Moves a ball that has reached the way out of its cell into the next one.
  /// @return the periods by which it went around the box: -1, 0 or +1
  int cross(Slot slot, Agenda<Real>& agenda) {
    const CellCoordinates before = agenda.cell;
    const std::size_t axis = agenda.crossing_axis;
    std::int32_t coordinate = before[axis] + agenda.crossing_direction;
    int turns = 0;
    if (grid_.axis(axis).periodic) {
      const std::int32_t count = grid_.count(axis, agenda.level);
      if (coordinate < 0) {
        coordinate = count - 1;
        turns = -1;
      } else if (coordinate == count) {
        coordinate = 0;
        turns = 1;
      }
    } else if (coordinate > kFarthestCell || coordinate < -kFarthestCell) {
      throw std::range_error("ball " + std::to_string(agenda.id) + " has flown 2^30 cells away");
    }
    agenda.cell[axis] = coordinate;
    grid_.move(slot, before, agenda.cell, axis, agenda.crossing_direction, agenda.level);
    return turns;
  }

  /// The balls that have come near by a crossing, the ball's last.
  Near newcomers(const Agenda<Real>& agenda) {
    grid_.gatherNew(agenda.cell, agenda.level, agenda.crossing_axis, agenda.crossing_direction,
                    candidates_);
    return found();
  }

  /// The cubes of which a ball must know when it leaves its own: cells, or regions ...
  const Lattice<Real>& cubes(const Agenda<Real>& agenda) const {
    return listed_ ? homes_ : grid_.latticeOf(agenda.level);
  }
  /// ... and which is its own.
  const CellCoordinates& cube(Slot slot, const Agenda<Real>& agenda) const {
    return listed_ ? lists_.home(slot) : agenda.cell;
  }

  // --- fetching ahead from memory

  void fetchList(Slot slot) const {
    if (listed_) lists_.fetch(slot);
  }
  /// The homes that a new list will be made from.
  void fetchHomes(const Agenda<Real>& agenda) {
    const Near near = inCellsAround(agenda);
    for (std::size_t i = 0; i < near.count; ++i) lists_.fetchHome(near.slots[i]);
  }
  /// The cells that near() looks into, where there are no lists, ...
  void fetchCells(const Agenda<Real>& agenda) const {
    if (!listed_) grid_.fetchNear(agenda.cell, agenda.level);
  }
  /// ... and those that cross() and newcomers() will.
  void fetchCellsToCross(const Agenda<Real>& agenda) const {
    if (listed_) return;
    grid_.fetchNew(agenda.cell, agenda.level, agenda.crossing_axis, agenda.crossing_direction);
  }
  /// Who will have come near by a crossing to come, on the ball's level alone.
  Near foreseeNewcomers(const Agenda<Real>& agenda) {
    grid_.foreseeNew(agenda.cell, agenda.level, agenda.crossing_axis, agenda.crossing_direction,
                     candidates_);
    return found();
  }

  std::size_t bytes() const { return grid_.bytes() + lists_.bytes(); }

 private:
  static constexpr std::int32_t kFarthestCell = 1 << 30;

  // Cells wide enough for lists, and the regions around homes.
  void cutIntoRegions(const Surroundings& surroundings, const std::vector<GridBall<Real>>& balls) {
    largest_ = 0;
    for (const GridBall<Real>& ball : balls) largest_ = std::max(largest_, ball.radius);
    const Real half = Real(NeighbourLists::kHalfRegion) * largest_;
    grid_ = layOutGrid<Real>(surroundings, balls, 2 * half);
    homes_ = grid_.lattice(NeighbourLists::kLatticeDepth);
    regions_.reach = static_cast<float>(2 * largest_ * Real(kCellMargin));
    for (std::size_t k = 0; k < 3; ++k) {
      regions_.width[k] = static_cast<std::int32_t>(2 * half / homes_.spacing[k]);
      regions_.round[k] = grid_.pointsRound(k, NeighbourLists::kLatticeDepth);
      regions_.spacing[k] = static_cast<float>(homes_.spacing[k]);
      homes_.half[k] = Real(regions_.width[k]) * homes_.spacing[k] / 2;
    }
  }

  std::uint8_t levelOf(Real radius) const {
    std::size_t level = grid_.finestLevel();
    while (level > 0 && radius > grid_.largestRadius(level)) --level;
    return static_cast<std::uint8_t>(level);
  }

  Near inCellsAround(const Agenda<Real>& agenda) {
    grid_.gatherNear(agenda.cell, agenda.level, candidates_);
    return found();
  }

  Near found() const { return {candidates_.slots.data(), candidates_.count}; }

  CellGrid<Real> grid_;
  NeighbourLists lists_;
  bool listed_ = false;
  Lattice<Real> homes_;    // of the lists, with the regions around them
  Regions regions_;        // the same, as the lists see them
  Real largest_ = 0;       // m, radius of the largest balls that the cells or lists allow for
  Candidates candidates_;  // scratch: the balls found last
};

}  // namespace ball_sim::core
