// How to cut space for a given set of balls: how wide the cells are, and which levels there are.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "event_driven/cell_grid.hpp"

namespace ball_sim::core {

/// So many balls fit, with all about them, into a core's own caches.
constexpr std::size_t kCachedBalls = 4000;

/// Balls per cell of a dilute scene, in the caches and beyond; wider cells are crossed less often,
/// but show more balls, and narrower ones take more memory.
constexpr double kBallsPerCachedCell = 0.35;
constexpr double kBallsPerCell = 0.5;

/// A level's guests get halved cells where so many share a cell of its members on average. With
/// fewer, the crossings of more cells cost what the large balls' searches gain. More parts of a
/// cell than these cost a large ball more than the guests that it is spared.
constexpr double kGuestsPerCell = 8;
constexpr double kMostParts = 512;

/// What the layout needs to know of a ball.
template <class Real>
struct GridBall {
  VectorOf<Real> x;  ///< m
  Real radius;       ///< m
};

namespace detail {

// Where balls are, or may be: the box, and on open axes the space the balls take now.
template <class Real>
void extent(const Surroundings& surroundings, const std::vector<GridBall<Real>>& balls, int axis,
            Real& low, Real& high) {
  low = Real(surroundings.box.min[axis]);
  high = Real(surroundings.box.max[axis]);
  if (std::isfinite(surroundings.box.min[axis]) && std::isfinite(surroundings.box.max[axis]))
    return;
  Real least = kNever<Real>;
  Real most = -kNever<Real>;
  for (const GridBall<Real>& ball : balls) {
    least = std::min(least, Real(ball.x[axis] - ball.radius));
    most = std::max(most, Real(ball.x[axis] + ball.radius));
  }
  if (balls.empty()) {
    least = -1;
    most = 1;
  }
  if (!std::isfinite(surroundings.box.min[axis])) low = std::min(least, high);
  if (!std::isfinite(surroundings.box.max[axis])) high = std::max(most, low);
}

// The positive root of a number, by Newton's method: the same bits with any mathematical library.
template <class Real>
Real root(Real number, int degree) {
  if (!(number > 0 && std::isfinite(number))) return number;
  int exponent = 0;
  std::frexp(number, &exponent);
  Real x = std::ldexp(Real(1), exponent / degree);  // within a factor of 2 ^ 1.5
  for (int step = 0; step < 8; ++step) {
    const Real power = degree == 2 ? x : x * x;
    x += (number / power - x) / Real(degree);
  }
  return x;
}

template <class Real>
Real shortestEdge(const std::array<GridAxis<Real>, 3>& axes) {
  Real shortest = kNever<Real>;
  for (const GridAxis<Real>& axis : axes) {
    if (!axis.flat) shortest = std::min(shortest, axis.edge);
  }
  return shortest;
}

// Their number, of cells whose edges are halved `depth` times.
template <class Real>
Real numberOfCells(const std::array<GridAxis<Real>, 3>& axes, int depth) {
  Real cells = 1;
  for (const GridAxis<Real>& axis : axes) {
    if (!axis.flat) cells *= Real(axis.cells) * Real(std::uint32_t{1} << depth);
  }
  return cells;
}

// How often the cells for a level's guests and its members' homes are halved: as finely as the next
// level's, where the guests are many, but not into more cells than pay.
template <class Real>
int homeDepth(const std::array<GridAxis<Real>, 3>& axes, int depth, std::size_t guests,
              int next_depth) {
  const Real cells = numberOfCells(axes, depth);
  if (Real(guests) < Real(kGuestsPerCell) * cells) return depth;
  const Real most = std::min(2 * Real(guests) + 64, Real(kMostParts) * cells);
  int home_depth = next_depth;
  while (numberOfCells(axes, home_depth) > most) --home_depth;
  return home_depth;
}

// Balls for which cells of one depth are just wide enough.
template <class Real>
struct SizeClass {
  std::size_t balls = 0;
  Real largest = 0;  // m, radius
};

template <class Real>
std::array<SizeClass<Real>, kMostLevels> sizeClasses(Real coarsest_edge,
                                                     const std::vector<GridBall<Real>>& balls) {
  std::array<SizeClass<Real>, kMostLevels> classes;
  for (const GridBall<Real>& ball : balls) {
    const Real ratio = coarsest_edge / (2 * ball.radius * Real(kCellMargin));
    std::size_t depth = 0;
    while (depth < kMostLevels - 1 && ratio >= Real(std::uint32_t{2} << depth)) ++depth;
    ++classes[depth].balls;
    classes[depth].largest = std::max(classes[depth].largest, ball.radius);
  }
  return classes;
}

// Levels for balls at most half as wide as those of the level before, where enough of them share
// the finest cells.
template <class Real>
std::vector<LevelPlan<Real>> planLevels(const std::array<GridAxis<Real>, 3>& axes,
                                        const std::vector<GridBall<Real>>& balls) {
  const Real coarsest_edge = shortestEdge(axes);
  const auto classes = sizeClasses(coarsest_edge, balls);
  std::vector<LevelPlan<Real>> plans;  // finest first
  LevelPlan<Real> plan;
  std::size_t members = 0;
  std::size_t guests = 0;
  for (int depth = kMostLevels - 1; depth >= 0; --depth) {
    const SizeClass<Real>& size = classes[static_cast<std::size_t>(depth)];
    members += size.balls;
    plan.largest = std::max(plan.largest, size.largest);
    const bool enough = members > 0 && numberOfCells(axes, depth) <= 4 * Real(members) + 64;
    if (depth > 0 && !enough) continue;
    plan.depth = depth;
    plan.home_depth = homeDepth(axes, depth, guests, plans.empty() ? depth : plans.back().depth);
    plans.push_back(plan);
    plan = {};
    plan.largest_guest = plans.back().largest;
    guests += std::exchange(members, 0);
  }
  // Where there is but one level it takes all that its cells take.
  if (plans.size() == 1) {
    plans[0].largest = std::max(plans[0].largest, coarsest_edge / (2 * Real(kCellMargin)));
  }
  std::reverse(plans.begin(), plans.end());
  return plans;
}

}  // namespace detail

/// Whether neighbour lists pay: they do in dense fluids of balls of about one size, where a ball
/// meets the same few others again and again. Measured in doc/performance.md.
template <class Real>
bool wantsLists(const Surroundings& surroundings, const std::vector<GridBall<Real>>& balls) {
  constexpr std::size_t kFewest = 100;  // balls
  constexpr double kMostUnequal = 1.5;  // ratio of radii
  constexpr double kDense = 0.3;        // packing fraction
  if (balls.size() < kFewest) return false;
  Real smallest = kNever<Real>;
  Real largest = 0;
  double filled = 0;
  const bool planar = surroundings.planar();
  for (const GridBall<Real>& ball : balls) {
    smallest = std::min(smallest, ball.radius);
    largest = std::max(largest, ball.radius);
    const auto r = double(ball.radius);
    filled += planar ? 3.14159265358979 * r * r : 4.18879020478639 * r * r * r;
  }
  if (largest > Real(kMostUnequal) * smallest) return false;
  double space = 1;
  for (int k = 0; k < (planar ? 2 : 3); ++k) {
    Real low = 0;
    Real high = 0;
    detail::extent(surroundings, balls, k, low, high);
    space *= double(high - low);
  }
  return filled > kDense * space;
}

/// Whether of a ball's images in a periodic box only the nearest can be met before a crossing:
/// balls in adjacent cells are less than two cells apart, so four cells along each axis are enough.
template <class Real>
bool nearestImagesSuffice(const CellGrid<Real>& grid) {
  for (std::size_t k = 0; k < 3; ++k) {
    if (grid.axis(k).periodic && grid.axis(k).cells < 4) return false;
  }
  return true;
}

/// @param balls  finite; may be empty
/// @param room   m, >= 0: cells are so much wider than the largest ball; above 0 there is but one
///               level
template <class Real>
CellGrid<Real> layOutGrid(const Surroundings& surroundings,
                          const std::vector<GridBall<Real>>& balls, Real room) {
  using std::floor;
  std::array<GridAxis<Real>, 3> axes;
  const int dimension = surroundings.planar() ? 2 : 3;
  std::array<Real, 3> low{};
  std::array<Real, 3> length{};
  Real volume = 1;
  for (int k = 0; k < 3; ++k) {
    GridAxis<Real>& axis = axes[static_cast<std::size_t>(k)];
    axis.flat = k >= dimension;
    if (axis.flat) continue;
    Real high = 0;
    detail::extent(surroundings, balls, k, low[static_cast<std::size_t>(k)], high);
    length[static_cast<std::size_t>(k)] = high - low[static_cast<std::size_t>(k)];
    volume *= length[static_cast<std::size_t>(k)];
    axis.periodic = surroundings.periodic;
    axis.lower_wall = !axis.periodic && std::isfinite(surroundings.box.min[k]);
    axis.upper_wall = !axis.periodic && std::isfinite(surroundings.box.max[k]);
  }

  // The coarsest cells take the largest balls, and are no finer than the balls are many.
  Real edge = 0;
  for (const GridBall<Real>& ball : balls) {
    edge = std::max(edge, Real(2 * ball.radius * Real(kCellMargin) + room));
  }
  const Real per_cell = Real(balls.size() > kCachedBalls ? kBallsPerCell : kBallsPerCachedCell);
  const Real roomiest = Real(balls.size()) / per_cell + 1;  // cells
  edge = std::max(edge, detail::root(volume / roomiest, dimension));
  if (!(edge > 0)) edge = 1;
  const auto cut = [&](std::size_t k) { return std::max(Real(1), floor(length[k] / edge)); };
  while (cut(0) * cut(1) * (dimension == 3 ? cut(2) : Real(1)) > 2 * roomiest) edge *= Real(1.25);

  for (std::size_t k = 0; k < 3; ++k) {
    GridAxis<Real>& axis = axes[k];
    if (axis.flat) continue;
    axis.cells = static_cast<std::uint32_t>(cut(k));
    axis.origin = low[k];
    if (!axis.open()) {
      axis.edge = length[k] / Real(axis.cells);
      continue;
    }
    std::uint32_t power = 1;
    while (power < axis.cells) power *= 2;
    axis.cells = power;
    axis.edge = edge;
    if (axis.upper_wall) axis.origin = low[k] + length[k] - Real(axis.cells) * edge;
  }

  if (room > 0) return CellGrid<Real>(axes, {LevelPlan<Real>{}});
  return CellGrid<Real>(axes, detail::planLevels(axes, balls));
}

}  // namespace ball_sim::core
