// How long an era of method continuous is. All times count from the start of an era, so that they
// stay fine. An era ends at a time that follows from the balls alone, whatever the frames: else
// times would be rounded otherwise.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "continuous/balls.hpp"

namespace ball_sim::core::continuous {

namespace detail {

template <class Real>
Real floorToPowerOfTwo(Real x) {
  int exponent = 0;
  using std::frexp;
  using std::ldexp;
  (void)frexp(x, &exponent);
  return ldexp(Real(1), exponent - 1);
}

}  // namespace detail

/// A power of two, in which no ball moves by more than about its distance from the origin, or some
/// radii: then a time is no less fine than a place. Scales with the scene, exactly.
/// @return s; +infinity: nothing moves
template <class Real, bool kGravity>
Real eraLength(const Balls<Real, kGravity>& balls) {
  using std::sqrt;
  Real length = 0;
  for (const Body<Real>& body : balls.bodies) length = std::max(length, 16 * body.radius);
  Real quarter = kNever<Real>;
  for (std::size_t k = 0; k < 3; ++k) {
    if (balls.box.period(k) > 0) quarter = std::min(quarter, balls.box.period(k) / 4);
  }
  length = std::min(length, quarter);
  Real era = kNever<Real>;
  for (Slot slot = 0; slot < balls.size(); ++slot) {
    const Body<Real>& body = balls.bodies[slot];
    const Real own = std::min(std::max(length, body.x.cwiseAbs().maxCoeff()), quarter);
    Real pace = body.v.cwiseAbs().maxCoeff();
    if constexpr (kGravity) pace += sqrt(balls.accelerations[slot].cwiseAbs().maxCoeff() * own);
    if (pace * era > own) era = own / pace;
  }
  return era < kNever<Real> ? detail::floorToPowerOfTwo(era) : era;
}

}  // namespace ball_sim::core::continuous
