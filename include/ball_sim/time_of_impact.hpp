// When do they meet? Times of impact of two balls, and of a ball and a wall, in closed form where
// there is one.
//
// The rule for contacts that rounding has moved (Bannerman, Strobl, Formella, Poeschel, "Stable
// algorithm for event detection in event-driven particle dynamics", 2014): an event happens only
// to partners that approach; those that overlap and approach meet now, those that overlap and
// recede do not meet. So an overlap of an ulp never grows and never repeats an impact.
#pragma once

#include <cmath>
#include <limits>
#include <utility>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// "Never", as a time.
template <class Real>
inline const Real kNever = std::numeric_limits<Real>::infinity();

/// Time until two balls in straight relative motion touch. Uniform gravity on both cancels.
/// @param dx     centre of b minus centre of a, m
/// @param dv     velocity of b minus velocity of a, m/s
/// @param reach  sum of the radii, m, > 0
/// @return s; 0 when they overlap (or touch) and approach; kNever when they never meet
///
/// The discriminant b^2 - a c is taken as a reach^2 - |dx x dv|^2, equal by Lagrange's identity:
/// it compares the distance of closest approach with the reach, so a graze seen from afar loses
/// only the digits of |dx|/reach and not their square. Limits: lengths and speeds whose fourth
/// powers fit the type.
template <class Real>
Real timeOfImpact(const VectorOf<Real>& dx, const VectorOf<Real>& dv, Real reach) {
  using std::sqrt;
  const Real b = dot(dx, dv);
  if (!(b < 0)) return kNever<Real>;
  const Real c = dot(dx, dx) - reach * reach;
  if (c <= 0) return 0;
  const Real discriminant = dot(dv, dv) * (reach * reach) - crossSquared(dx, dv);
  if (!(discriminant > 0)) return kNever<Real>;
  return c / (sqrt(discriminant) - b);
}

/// Time until a ball under constant acceleration touches a wall.
/// @param gap    distance of the ball's surface from the wall, m; below 0: overlap
/// @param speed  of the ball along the wall's inward normal, m/s
/// @param acceleration  along the inward normal, m/s^2
/// @return s; 0 when in contact and approaching (or pressed on it at rest); kNever when they never
///         meet. A ball in contact that leaves and is pulled back returns after 2 speed/|accel.|.
template <class Real>
Real timeToWall(Real gap, Real speed, Real acceleration) {
  using std::sqrt;
  const Real distance = gap > 0 ? gap : Real(0);
  if (speed < 0 && distance == 0) return 0;
  if (acceleration == 0) return speed < 0 ? distance / -speed : kNever<Real>;
  const Real discriminant = speed * speed - 2 * acceleration * distance;
  if (acceleration < 0) {  // pulled to the wall: sooner or later it gets there
    const Real root = sqrt(discriminant);
    return speed > 0 ? (speed + root) / -acceleration
                     : (root - speed > 0 ? 2 * distance / (root - speed) : Real(0));
  }
  if (!(speed < 0) || !(discriminant > 0)) return kNever<Real>;
  return 2 * distance / (sqrt(discriminant) - speed);
}

namespace detail {

/// The sign change of a continuous function with f(low) and f(high) on different sides of zero,
/// by Newton steps that fall back on bisection; to the last bit or two.
template <class Real, class Function, class Derivative>
Real bracketedRoot(Function f, Derivative slope, Real low, Real high) {
  const bool low_is_positive = f(low) > 0;
  Real t = low + (high - low) / 2;
  for (int i = 0; i < 200; ++i) {
    const Real value = f(t);
    if ((value > 0) == low_is_positive) {
      low = t;
    } else {
      high = t;
    }
    Real next = t - value / slope(t);
    if (!(next > low && next < high)) next = low + (high - low) / 2;
    if (next == t || !(next > low && next < high)) break;
    t = next;
  }
  return t;
}

}  // namespace detail

/// Time until two balls under different constant accelerations touch: a free ball and one that is
/// fixed or rests on a wall.
/// @param dx, dv, da  place, velocity, acceleration of b minus those of a; da not zero
/// @param reach  sum of the radii, m, > 0
/// @return s; 0 when they overlap and approach; kNever when they never meet
///
/// The squared distance is a quartic in t. Its slope is a cubic whose own slope is a quadratic, so
/// the stretches on which the distance falls are bracketed one inside the other, and the first
/// contact is the one sign change in the first stretch that reaches the sum of radii.
template <class Real>
Real timeOfImpactAccelerated(const VectorOf<Real>& dx, const VectorOf<Real>& dv,
                             const VectorOf<Real>& da, Real reach) {
  using std::sqrt;
  // Half the slope of the squared distance: g0 + g1 t + g2 t^2 + g3 t^3.
  const Real g0 = dot(dx, dv);
  const Real g1 = dot(dv, dv) + dot(dx, da);
  const Real g2 = Real(1.5) * dot(dv, da);
  const Real g3 = Real(0.5) * dot(da, da);
  const auto slope = [&](Real t) { return g0 + t * (g1 + t * (g2 + t * g3)); };
  const auto slope2 = [&](Real t) { return g1 + t * (2 * g2 + t * 3 * g3); };
  const auto excess = [&](Real t) {
    const VectorOf<Real> d = dx + t * (dv + (t / 2) * da);
    return dot(d, d) - reach * reach;
  };
  const auto twice_slope = [&](Real t) { return 2 * slope(t); };

  // Ends of the stretches on which the slope is monotonic.
  Real ends[4] = {0, 0, 0, 0};
  int count = 1;
  const Real quarter = g2 * g2 - 3 * g1 * g3;
  if (quarter > 0) {
    const Real q = -(g2 + (g2 < 0 ? -1 : 1) * sqrt(quarter));
    Real first = q / (3 * g3);
    Real second = q != 0 ? g1 / q : first;
    if (first > second) std::swap(first, second);
    if (first > 0) ends[count++] = first;
    if (second > 0) ends[count++] = second;
  }
  Real last = ends[count - 1] > 0 ? 2 * ends[count - 1] : Real(1);
  while (!(slope(last) > 0)) last *= 2;  // g3 > 0: it ends in rising
  ends[count++] = last;

  // Walk the stretches; `fall` is where the present fall of the distance began.
  // At relative rest what comes next decides: it is where the quartic leaves its turning point.
  bool falling = g0 < 0 || (g0 == 0 && (g1 < 0 || (g1 == 0 && g2 < 0)));
  Real fall = 0;
  for (int i = 0; i + 1 < count; ++i) {
    const bool falls_at_end = slope(ends[i + 1]) < 0;
    if (falling == falls_at_end) continue;
    const Real turn = detail::bracketedRoot(slope, slope2, ends[i], ends[i + 1]);
    if (falling) {
      if (excess(fall) <= 0) return fall;
      if (excess(turn) <= 0) return detail::bracketedRoot(excess, twice_slope, fall, turn);
    }
    falling = falls_at_end;
    fall = turn;
  }
  return kNever<Real>;
}

}  // namespace ball_sim::core
