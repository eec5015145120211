// When, and by which face, does a ball leave the cube it is in? The cubes are the cells of a grid,
// or the regions around homes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/vector.hpp"
#include "ball_sim/walls.hpp"
#include "event_driven/cell_grid.hpp"

namespace ball_sim::core {

template <class Real>
struct WayOut {
  Real wait = kNever<Real>;  ///< s, >= 0; kNever: it stays
  std::uint8_t axis = 0;
  std::int8_t direction = 1;  ///< -1 or +1
};

/// Of a ball in straight flight. Without branches: which way out comes first cannot be foretold.
/// @param x  m
/// @param v  m/s
template <class Real>
WayOut<Real> wayOut(const VectorOf<Real>& x, const VectorOf<Real>& v, const Lattice<Real>& cubes,
                    const CellCoordinates& cube) {
  std::array<Real, 3> wait;
  for (std::size_t k = 0; k < 3; ++k) {
    const int i = static_cast<int>(k);
    const Real from_middle = x[i] - (cubes.first[k] + Real(cube[k]) * cubes.spacing[k]);
    const Real towards = cubes.half[k] - from_middle * std::copysign(Real(1), v[i]);
    wait[k] = std::max(towards, std::numeric_limits<Real>::min()) / std::abs(v[i]);
  }
  if (cubes.has_ends) {
    for (std::size_t k = 0; k < 3; ++k) {  // where there is no way out
      if (cube[k] == cubes.end[k][v[static_cast<int>(k)] < 0 ? 0 : 1]) wait[k] = kNever<Real>;
    }
  }
  const Real sooner = std::min(wait[0], wait[1]);
  const unsigned second = wait[1] < wait[0] ? 1 : 0;
  const unsigned third = wait[2] < sooner ? 1 : 0;
  const unsigned k = 2 * third + (second & ~third);
  WayOut<Real> way;
  way.wait = std::min(sooner, wait[2]);
  way.axis = static_cast<std::uint8_t>(k);
  way.direction = v[static_cast<int>(k)] < 0 ? -1 : 1;
  return way;
}

/// Of one that falls.
/// @param a  its acceleration, m/s^2
template <class Real>
WayOut<Real> wayOutFalling(const VectorOf<Real>& x, const VectorOf<Real>& v,
                           const VectorOf<Real>& a, const Lattice<Real>& cubes,
                           const CellCoordinates& cube) {
  WayOut<Real> way;
  for (std::size_t k = 0; k < 3; ++k) {
    const int i = static_cast<int>(k);
    const Real from_middle = x[i] - (cubes.first[k] + Real(cube[k]) * cubes.spacing[k]);
    for (const int direction : {-1, 1}) {
      if (cube[k] == cubes.end[k][direction < 0 ? 0 : 1]) continue;  // there is no way out
      const Real gap = cubes.half[k] - Real(direction) * from_middle;
      const Real wait = timeToWall<Real>(gap, Real(-direction) * v[i], Real(-direction) * a[i]);
      if (!(wait < way.wait)) continue;
      way.wait = wait;
      way.axis = static_cast<std::uint8_t>(k);
      way.direction = static_cast<std::int8_t>(direction);
    }
  }
  return way;
}

}  // namespace ball_sim::core
