// Impacts that balls are heading for: whether they are still to come, which is first, and what an
// impact of two balls leads to. Nothing here changes a ball.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "ball_sim/ball.hpp"
#include "continuous/balls.hpp"
#include "continuous/buffer.hpp"
#include "impact.hpp"

namespace ball_sim::core::continuous {

/// Partners from here on are walls: this plus their index.
constexpr std::uint32_t kWall = 0xF8000000;

/// An impact that will happen if neither partner changes before.
template <class Real>
struct Impact {
  Real time;           ///< s, in this era
  std::uint32_t a, b;  ///< slots; b may be a wall
  std::uint32_t version_a, version_b;
  Turns image;  ///< b is met so many periods from where its body says
};

/// Whether a partner has changed since the impact was found.
template <class Real, bool kGravity>
bool isStale(const Impact<Real>& impact, const Balls<Real, kGravity>& balls) {
  return balls.cards[impact.a].version != impact.version_a ||
         (impact.b < kWall && balls.cards[impact.b].version != impact.version_b);
}

/// Order of impacts: by time, then the smaller id (walls before all), then the larger.
template <class Real, bool kGravity>
class ImpactOrder {
 public:
  explicit ImpactOrder(const Balls<Real, kGravity>& balls) : balls_(&balls) {}

  /// Whether `first` comes before `second`.
  bool operator()(const Impact<Real>& first, const Impact<Real>& second) const {
    if (first.time != second.time) return first.time < second.time;
    return namesOf(first) < namesOf(second);
  }

 private:
  std::pair<Partner, Partner> namesOf(const Impact<Real>& impact) const {
    const Partner a = balls_->cards[impact.a].id;
    const Partner b =
        impact.b >= kWall ? balls_->walls[impact.b - kWall].partner : balls_->cards[impact.b].id;
    return {std::min(a, b), std::max(a, b)};
  }

  const Balls<Real, kGravity>* balls_;
};

/// Impacts that wait for their turn: a heap, the earliest first.
template <class Real, bool kGravity>
class ImpactHeap {
 public:
  explicit ImpactHeap(const Balls<Real, kGravity>& balls) : before_(balls) {}

  void push(const Impact<Real>& impact) {
    impacts_.push_back(impact);
    std::push_heap(impacts_.begin(), impacts_.end(), after());
  }

  void pop() {
    std::pop_heap(impacts_.begin(), impacts_.end(), after());
    impacts_.pop_back();
  }

  void clear() { impacts_.clear(); }
  void giveBackRoom() { impacts_.giveBackRoom(); }

  /// All, as the heap has them; the first is the earliest, those after it are among the next.
  const Buffer<Impact<Real>>& impacts() const { return impacts_; }

 private:
  auto after() const {
    return [this](const Impact<Real>& a, const Impact<Real>& b) { return before_(b, a); };
  }

  ImpactOrder<Real, kGravity> before_;
  Buffer<Impact<Real>> impacts_;
};

/// A ball after an impact.
template <class Real>
struct Side {
  Body<Real> body;
  Card<Real> card;  ///< still with the version of before
};

/// What an impact of two balls leads to.
template <class Real>
struct Outcome {
  Impact<Real> impact;              ///< a has the smaller id
  std::array<Side<Real>, 2> sides;  ///< of a and b
  BallImpact<Real> passed;

  Slot slot(std::size_t side) const { return side == 0 ? impact.a : impact.b; }
  Slot partnerOf(Slot slot) const { return slot == impact.a ? impact.b : impact.a; }
  bool happens() const { return passed.exchange.impulse > 0; }
  Real reach() const { return sides[0].body.radius + sides[1].body.radius; }  ///< m
};

/// Computes what an impact of two balls leads to, if they go on as they are.
/// @param outcome  is set (large, so it is written in place)
template <class Real, bool kGravity>
void foresee(Impact<Real> impact, const Balls<Real, kGravity>& balls, Outcome<Real>& outcome) {
  if (balls.cards[impact.b].id < balls.cards[impact.a].id) {
    std::swap(impact.a, impact.b);
    std::swap(impact.version_a, impact.version_b);
    for (std::int16_t& turns : impact.image) turns = static_cast<std::int16_t>(-turns);
  }
  outcome.impact = impact;
  auto& [a, b] = outcome.sides;
  a.body = balls.bodyAt(impact.a, impact.time);
  b.body = balls.bodyAt(impact.b, impact.time);
  a.card = balls.cards[impact.a];
  b.card = balls.cards[impact.b];
  VectorOf<Real> dx = b.body.x - a.body.x;
  if (balls.box.repeats()) dx += balls.box.shiftOf(impact.image);
  const VectorOf<Real> pressing = balls.acceleration(impact.a) - balls.acceleration(impact.b);
  outcome.passed = meetBall<Real>(dx, outcome.reach(), pressing, balls.restitution, impact.time,
                                  {a.body.v, balls.inverseMass(impact.a), a.card.history},
                                  {b.body.v, balls.inverseMass(impact.b), b.card.history});
  a.body.x = balls.box.wrapped(a.body.x);
  b.body.x = balls.box.wrapped(b.body.x);
  a.card.met = b.card.id;
  b.card.met = a.card.id;
  a.card.met_normal = b.card.met_normal = outcome.passed.normal;
}

}  // namespace ball_sim::core::continuous
