// What happens when balls meet, or a ball and a wall: collision law, guard against collapse, and
// coming to rest, in the one order in which the exact methods apply them.
#pragma once

#include "ball_sim/collapse_guard.hpp"
#include "ball_sim/collision_law.hpp"
#include "ball_sim/walls.hpp"

namespace ball_sim::core {

/// A partner of an impact, as it is at that instant.
template <class Real>
struct Impacting {
  VectorOf<Real>& v;             ///< m/s; changed
  Real inverse_mass;             ///< 1/kg; 0: fixed
  ImpactHistory<Real>& history;  ///< changed where restitution is below 1
};

/// What passed between two balls.
template <class Real>
struct BallImpact {
  VectorOf<Real> normal;    ///< from a to b
  Real overlap;             ///< m
  Exchange<Real> exchange;  ///< impulse 0: nothing happened
};

/// Applies an impact to two balls.
/// @param dx     from a to the image of b that it meets, m
/// @param reach  sum of the radii, m
/// @param pressing  acceleration of a minus that of b, m/s^2
/// @param now    s, on the clock of the histories
template <class Real>
BallImpact<Real> meetBall(const VectorOf<Real>& dx, Real reach, const VectorOf<Real>& pressing,
                          Real restitution, Real now, const Impacting<Real>& a,
                          const Impacting<Real>& b) {
  const VectorOf<Real> normal = contactNormal<Real>(dx);
  const Real least = leastRebound<Real>(dot(pressing, normal), reach);
  if (restitution < 1) {
    const Real speed = dot(a.v, normal) - dot(b.v, normal);
    const bool a_collapses = a.history.record(now, speed, reach);
    const bool b_collapses = b.history.record(now, speed, reach);
    if (a_collapses || b_collapses) restitution = 1;
  }
  return {normal, reach - dot(dx, normal),
          collide<Real>(a.v, a.inverse_mass, b.v, b.inverse_mass, normal, restitution, least)};
}

/// What passed between a ball and a wall.
template <class Real>
struct WallImpact {
  Real overlap;      ///< m
  Real speed;        ///< m/s, of approach; <= 0: it slid along the wall, and nothing happened
  Real restitution;  ///< that held: 1 in a collapse
  bool rests;        ///< the ball is on the wall from now on
};

/// Applies an impact to a ball and a wall.
/// @param x     place of the ball, m
/// @param pull  its acceleration along the wall's inward normal, m/s^2
/// @param now   s, on the clock of the history
template <class Real>
WallImpact<Real> meetWall(const Wall<Real>& wall, const VectorOf<Real>& x, Real radius, Real pull,
                          Real restitution, Real now, const Impacting<Real>& ball) {
  WallImpact<Real> impact;
  impact.speed = -dot(ball.v, wall.normal);
  impact.overlap = wall.offset + radius - dot(x, wall.normal);
  impact.restitution = restitution;
  if (restitution < 1 && !(pull < 0) && ball.history.record(now, impact.speed, radius)) {
    impact.restitution = 1;
  }
  collideWithWall<Real>(ball.v, wall.normal, impact.restitution);
  impact.rests = comesToRest<Real>(dot(ball.v, wall.normal), pull, radius);
  return impact;
}

}  // namespace ball_sim::core
