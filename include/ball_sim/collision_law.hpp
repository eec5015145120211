// The collision law: what an impact does to two smooth balls, or to a ball and a wall.
//
// With n = (c2 - c1)/|c2 - c1| and K = 2 (v1.n - v2.n)/(M1 + M2),
//   v1' = v1 - K M2 n,   v2' = v2 + K M1 n.
// Restitution e turns the 2 into 1 + e. Written with reciprocal masses w = 1/M, so that an infinite
// mass is w = 0 and not a special case: K M2 = (1 + e) u w1/(w1 + w2), u = v1.n - v2.n. The share
// w1/(w1 + w2) is exactly 1/2 for equal masses, which then swap their normal speeds exactly.
//
// Assumes smooth balls (no friction, no spin) and an instantaneous impact of two partners.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// Unit vector along `dx`, for any length from the smallest denormal to the largest double.
/// @param dx  centre of 2 minus centre of 1, m
/// @return the direction; the x axis when the centres coincide (any fixed choice conserves all)
template <class Real>
VectorOf<Real> contactNormal(const VectorOf<Real>& dx) {
  using std::sqrt;
  const Real squared = dot(dx, dx);
  if (squared > Real(1e-200) && squared < Real(1e200)) return dx / sqrt(squared);
  const Real scale = dx.cwiseAbs().maxCoeff();  // squares would leave the range of doubles
  if (!(scale > 0)) return VectorOf<Real>::UnitX();
  const VectorOf<Real> scaled = dx / scale;
  return scaled / sqrt(dot(scaled, scaled));
}

/// How far the rounding of v's components may falsify its speed along `normal`, m/s.
///
/// An approach no faster than this may be an approach or none: partners that touch and slide past
/// each other could meet for ever, with changes of velocity that are rounded away. So they are made
/// to part by as much, which no measurement would show, and the next look at them finds them apart.
template <class Real>
Real roundingAlong(const VectorOf<Real>& v, const VectorOf<Real>& normal) {
  using std::abs;
  constexpr int kUlps = 16;
  return kUlps * std::numeric_limits<Real>::epsilon() *
         (abs(v[0] * normal[0]) + abs(v[1] * normal[1]) + abs(v[2] * normal[2]));
}

/// What passes between two partners at an impact, along the normal from 1 to 2.
template <class Real>
struct Exchange {
  Real approach_speed = 0;  ///< m/s, v1.n - v2.n before; <= 0: they separate and nothing happens
  Real change1 = 0;         ///< m/s, ball 1 loses this much of its speed along n
  Real change2 = 0;         ///< m/s, ball 2 gains this much
  Real impulse = 0;         ///< N s
};

/// The exchange of two balls that touch.
/// @param v1, v2  velocities before, m/s
/// @param w1, w2  reciprocal masses, 1/kg, >= 0 (0: fixed), not both 0
/// @param normal  unit vector from 1 to 2
/// @param restitution  0..1
/// @param least_rebound  m/s, >= 0: they part at least this fast (see collapse_guard.hpp); 0: none
/// @return all changes 0 unless they approach, to rounding
template <class Real>
Exchange<Real> exchange(const VectorOf<Real>& v1, Real w1, const VectorOf<Real>& v2, Real w2,
                        const VectorOf<Real>& normal, Real restitution, Real least_rebound = 0) {
  Exchange<Real> result;
  using std::abs;
  result.approach_speed = dot(v1, normal) - dot(v2, normal);
  const Real rounding = roundingAlong(v1, normal) + roundingAlong(v2, normal);
  if (abs(result.approach_speed) <= rounding) least_rebound = std::max(least_rebound, rounding);
  if (!(result.approach_speed > -least_rebound)) return result;
  const Real total = w1 + w2;
  Real relative_change = (1 + restitution) * result.approach_speed;
  if (relative_change < result.approach_speed + least_rebound) {
    relative_change = result.approach_speed + least_rebound;
  }
  result.change1 = relative_change * (w1 / total);
  result.change2 = relative_change * (w2 / total);
  result.impulse = relative_change / total;
  return result;
}

/// Applies the collision law to two balls that touch.
/// @param v1, v2  velocities, m/s; changed in place
/// @return what passed between them
template <class Real>
Exchange<Real> collide(VectorOf<Real>& v1, Real w1, VectorOf<Real>& v2, Real w2,
                       const VectorOf<Real>& normal, Real restitution, Real least_rebound = 0) {
  const Exchange<Real> passed = exchange(v1, w1, v2, w2, normal, restitution, least_rebound);
  v1 -= passed.change1 * normal;
  v2 += passed.change2 * normal;
  return passed;
}

/// The same against a wall at rest: the limit of an infinite second mass.
/// @param v  velocity, m/s; changed in place
/// @param inward  unit normal of the wall, towards the ball
/// @return speed of approach, m/s; <= 0: it leaves, and nothing happened but to rounding
template <class Real>
Real collideWithWall(VectorOf<Real>& v, const VectorOf<Real>& inward, Real restitution) {
  using std::abs;
  const Real approach_speed = -dot(v, inward);
  const Real rounding = roundingAlong(v, inward);
  const Real least_rebound = abs(approach_speed) <= rounding ? rounding : Real(0);
  if (!(approach_speed > -least_rebound)) return approach_speed;
  Real change = (1 + restitution) * approach_speed;
  if (change < approach_speed + least_rebound) change = approach_speed + least_rebound;
  v += change * inward;
  return approach_speed;
}

}  // namespace ball_sim::core
