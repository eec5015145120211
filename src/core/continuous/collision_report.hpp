// What a slice puts into the log of collisions, in order of time: impacts in turn, each after what
// led to it, and between them those that were planned.
#pragma once

#include <algorithm>
#include <cstddef>

#include "ball_sim/method.hpp"
#include "continuous/balls.hpp"
#include "continuous/buffer.hpp"
#include "continuous/impacts.hpp"

namespace ball_sim::core::continuous {

/// The impact of two balls as a log tells it.
/// @param origin  when this era began
template <class Real, bool kGravity>
Collision collisionOf(const Outcome<Real>& outcome, const Balls<Real, kGravity>& balls,
                      const Time& origin) {
  const Body<Real>& a = outcome.sides[0].body;
  const BallImpact<Real>& passed = outcome.passed;
  const VectorOf<Real> point = balls.box.wrapped(a.x + a.radius * passed.normal);
  Collision collision;
  collision.time = origin + double(outcome.impact.time);
  collision.a = balls.cards[outcome.impact.a].id;
  collision.b = balls.cards[outcome.impact.b].id;
  collision.point = point.template cast<double>();
  collision.normal = passed.normal.template cast<double>();
  collision.impulse = double(passed.exchange.impulse);
  collision.approach_speed = double(passed.exchange.approach_speed);
  return collision;
}

/// The same of a ball and a wall.
/// @param body    of the ball, at the impact
/// @param change  m/s, what the impact took of its speed along the wall's normal
/// @param speed   m/s, of approach
template <class Real, bool kGravity>
Collision collisionWithWall(const Impact<Real>& impact, const Body<Real>& body, Real change,
                            Real speed, const Balls<Real, kGravity>& balls, const Time& origin) {
  const Wall<Real>& wall = balls.walls[impact.b - kWall];
  const Card<Real>& card = balls.cards[impact.a];
  const VectorOf<Real> point = balls.box.wrapped(body.x - body.radius * wall.normal);
  Collision collision;
  collision.time = origin + double(impact.time);
  collision.a = card.id;
  collision.b = wall.partner;
  collision.point = point.template cast<double>();
  collision.normal = (-wall.normal).template cast<double>();
  collision.impulse = double(change * Real(card.mass));
  collision.approach_speed = double(speed);
  return collision;
}

template <class Real, bool kGravity>
class CollisionReport {
 public:
  /// @param balls  outlive the report
  explicit CollisionReport(const Balls<Real, kGravity>& balls) : balls_(balls), before_(balls) {}

  void addInTurn(const Impact<Real>& impact, const Collision& collision) {
    in_turn_.push_back({impact, collision});
  }

  /// @param outcome  stays where it is until the report is given
  void addPlanned(const Outcome<Real>& outcome) { planned_.push_back(&outcome); }

  /// Gives the report, and begins a new one.
  void giveTo(CollisionLog& log, const Time& origin) {
    std::sort(planned_.begin(), planned_.end(),
              [this](const Outcome<Real>* a, const Outcome<Real>* b) {
                return before_(a->impact, b->impact);
              });
    auto next = planned_.begin();
    for (const InTurn& in_turn : in_turn_) {
      for (; next != planned_.end() && before_((*next)->impact, in_turn.impact); ++next) {
        log.add(collisionOf(**next, balls_, origin));
      }
      log.add(in_turn.collision);
    }
    for (; next != planned_.end(); ++next) log.add(collisionOf(**next, balls_, origin));
    in_turn_.clear();
    planned_.clear();
  }

  void giveBackRoom() {
    in_turn_.giveBackRoom();
    planned_.giveBackRoom();
  }

  std::size_t bytes() const { return capacityBytes(in_turn_) + capacityBytes(planned_); }

 private:
  struct InTurn {
    Impact<Real> impact;
    Collision collision;
  };

  const Balls<Real, kGravity>& balls_;
  ImpactOrder<Real, kGravity> before_;
  Buffer<InTurn> in_turn_;
  Buffer<const Outcome<Real>*> planned_;
};

}  // namespace ball_sim::core::continuous
