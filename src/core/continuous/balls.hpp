// The balls of method continuous: on what path each goes, and what it keeps in mind of its impacts.
//
// A place is stored at a ball's own last change and nowhere else: reading, planning and frames
// leave no trace in a trajectory. From there a path is straight, or a parabola where balls fall.
//
// (In a namespace, as event_driven has other bodies, balls and impacts.)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/collapse_guard.hpp"
#include "ball_sim/surroundings.hpp"
#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/vector.hpp"
#include "ball_sim/walls.hpp"
#include "capacity_bytes.hpp"
#include "continuous/periodic_box.hpp"
#include "continuous/swept_lanes.hpp"
#include "continuous/worker_pool.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "permutation.hpp"

namespace ball_sim::core::continuous {

/// Where a ball is in memory. Frames give new ones, in the order of space.
using Slot = std::uint32_t;

constexpr BallId kNobody = ~BallId{0};

/// What others look at, in one cache line: the place at the ball's own time.
template <class Real>
struct alignas(64) Body {
  VectorOf<Real> x;  ///< m, at `time`; within the periodic box
  VectorOf<Real> v;  ///< m/s, at `time`
  Real time;         ///< s, in this era
  Real radius;       ///< m
};

/// What only an impact needs.
template <class Real>
struct alignas(64) Card {
  double mass = 0;                                     ///< kg
  VectorOf<Real> met_normal = VectorOf<Real>::Zero();  ///< of that impact, from the smaller id
  ImpactHistory<Real> history;                         ///< on the clock of this era
  BallId id = 0;
  BallId met = kNobody;       ///< partner of the last impact, when no change came after it
  std::uint32_t version = 0;  ///< another one after each change of this ball's path
};

/// The way on which a ball goes, or would go if a plan came true.
template <class Real>
struct Path {
  Slot slot;
  const Body<Real>* body;
  const Card<Real>* card;
};

/// When a ball, left to itself, meets a wall.
template <class Real>
struct WallVisit {
  Real time = kNever<Real>;  ///< s, in this era
  std::uint32_t wall = 0;    ///< index into the walls
};

/// Arrays by slot, without gaps.
/// @tparam kGravity  whether balls fall; without it no acceleration is stored or computed
template <class Real, bool kGravity>
struct Balls {
  using Vec = VectorOf<Real>;

  explicit Balls(const Surroundings& surroundings)
      : box(surroundings),
        walls(wallsOf<Real>(surroundings)),
        gravity(surroundings.gravity.cast<Real>()),
        restitution(Real(surroundings.restitution)) {}

  PeriodicBox<Real> box;
  std::vector<Wall<Real>> walls;
  Vec gravity;       ///< m/s^2
  Real restitution;  ///< 0..1

  HugePageVector<Body<Real>> bodies;
  HugePageVector<Card<Real>> cards;
  HugePageVector<Vec> accelerations;         ///< m/s^2; only with gravity
  std::vector<RestingContacts> resting;      ///< only with gravity
  std::vector<WallVisit<Real>> wall_visits;  ///< only with walls
  std::vector<Slot> slots;                   ///< by ascending id

  std::size_t size() const { return bodies.size(); }

  // --- ids and slots

  std::vector<Slot>::iterator find(BallId id) {
    return std::lower_bound(slots.begin(), slots.end(), id,
                            [this](Slot slot, BallId other) { return cards[slot].id < other; });
  }
  std::vector<Slot>::const_iterator find(BallId id) const {
    return const_cast<Balls*>(this)->find(id);
  }

  /// Adds a ball. @param id  larger than all before it
  /// @param now  s, in this era
  void insert(BallId id, const Ball& ball, Real now) {
    const auto slot = static_cast<Slot>(bodies.size());
    bodies.push_back(
        {ball.position.cast<Real>(), ball.velocity.cast<Real>(), now, Real(ball.radius)});
    Card<Real> card;
    card.mass = ball.mass;
    card.id = id;
    cards.push_back(card);
    if constexpr (kGravity) {
      accelerations.push_back(isFixed(slot) ? Vec(Vec::Zero()) : gravity);
      resting.emplace_back();
    }
    if (!walls.empty()) wall_visits.push_back({});
    slots.push_back(slot);
    bringHome(slot);
  }

  /// Takes a ball out; the last one takes the slot that is free now.
  void remove(BallId id) {
    const auto found = find(id);
    const Slot slot = *found;
    slots.erase(found);
    const auto last = static_cast<Slot>(bodies.size() - 1);
    if (slot != last) *find(cards[last].id) = slot;
    forEachArray([&](auto& values) {
      values[slot] = values[last];
      values.pop_back();
    });
  }

  /// Gives the balls other slots. @param to  by slot, a permutation
  template <class Indices>
  void moveTo(const Indices& to, WorkerPool& pool) {
    for (Slot& slot : slots) slot = to[slot];
    moved_.resize(pool.size());
    pool.run([&](unsigned worker) {
      unsigned array = 0;
      forEachArray([&](auto& values) {
        if (array++ % pool.size() == worker) moveToPlaces(values, to, moved_[worker]);
      });
    });
  }

  /// Vectors that grew ball by ball have up to twice the room that they need.
  void giveBackRoom() {
    const auto trim = [](auto& values) {
      if (values.capacity() > values.size() + values.size() / 4) values.shrink_to_fit();
    };
    forEachArray(trim);
    trim(slots);
  }

  std::size_t bytes() const {
    std::size_t bytes = capacityBytes(bodies) + capacityBytes(cards) +
                        capacityBytes(accelerations) + capacityBytes(resting) +
                        capacityBytes(wall_visits) + capacityBytes(slots);
    for (const std::vector<bool>& moved : moved_) bytes += moved.capacity() / 8;
    return bytes;
  }

  // --- motion between impacts

  bool isFixed(Slot slot) const { return std::isinf(cards[slot].mass); }
  Real inverseMass(Slot slot) const { return 1 / Real(cards[slot].mass); }  ///< 1/kg; 0: fixed

  /// m/s^2
  Vec acceleration(Slot slot) const {
    if constexpr (kGravity) return accelerations[slot];
    return Vec::Zero();
  }

  bool isResting(Slot slot) const {
    if constexpr (kGravity) return resting[slot].count > 0;
    return false;
  }

  Path<Real> pathOf(Slot slot) const { return {slot, &bodies[slot], &cards[slot]}; }

  /// m, at a time of this era.
  Vec positionAt(const Path<Real>& path, Real time) const {
    const Body<Real>& body = *path.body;
    const Real dt = time - body.time;
    if constexpr (kGravity) return body.x + dt * (body.v + (dt / 2) * accelerations[path.slot]);
    return body.x + dt * body.v;
  }
  Vec positionAt(Slot slot, Real time) const { return positionAt(pathOf(slot), time); }

  /// m/s, at a time of this era.
  Vec velocityAt(const Path<Real>& path, Real time) const {
    const Body<Real>& body = *path.body;
    if constexpr (kGravity) return body.v + (time - body.time) * accelerations[path.slot];
    return body.v;
  }
  Vec velocityAt(Slot slot, Real time) const { return velocityAt(pathOf(slot), time); }

  /// The ball as it is at a time; its place may be out of the periodic box.
  Body<Real> bodyAt(Slot slot, Real time) const {
    return {positionAt(slot, time), velocityAt(slot, time), time, bodies[slot].radius};
  }

  /// When and where a ball, left to itself, meets its next wall.
  /// @param body  as it is, or would be
  WallVisit<Real> wallVisit(Slot slot, const Body<Real>& body) const {
    if (isFixed(slot)) return {};
    if constexpr (!kGravity) return straightWallVisit(body);
    WallVisit<Real> visit;
    for (std::size_t k = 0; k < walls.size(); ++k) {
      const Wall<Real>& wall = walls[k];
      if (resting[slot].includes(static_cast<int>(k))) continue;
      const Real pull = dot(accelerations[slot], wall.normal);
      const Real gap = dot(body.x, wall.normal) - wall.offset - body.radius;
      const Real time = body.time + timeToWall<Real>(gap, dot(body.v, wall.normal), pull);
      if (time < visit.time) visit = {time, static_cast<std::uint32_t>(k)};
    }
    return visit;
  }

  /// Fetches from memory what an impact of a ball will need.
  void fetch(Slot slot) const {
    touch(&bodies[slot]);
    touch(&cards[slot]);
    if (!walls.empty()) touch(&wall_visits[slot]);
  }

  // --- changes

  /// Stores the place of now, for a change of velocity to start from.
  void settle(Slot slot, Real now) {
    bodies[slot] = bodyAt(slot, now);
    bringHome(slot);
  }

  /// Takes the stored place into the periodic box by whole periods.
  void bringHome(Slot slot) { bodies[slot].x = box.wrapped(bodies[slot].x); }

  /// After any change of velocity: impacts found with the old one are stale; walls rested on are
  /// left or kept.
  /// @param met  the ball it was an impact with
  void velocityChanged(Slot slot, BallId met = kNobody) {
    cards[slot].version = ++last_version_;
    cards[slot].met = met;
    if constexpr (kGravity) {
      if (resting[slot].count == 0) return;
      Body<Real>& body = bodies[slot];
      accelerations[slot] =
          settleContacts<Real>(resting[slot], body.v, body.radius, gravity, walls);
    }
  }

  /// Reserves versions for paths to come.
  /// @return the first of `count` that follow each other
  std::uint32_t takeVersions(std::size_t count) {
    const std::uint32_t first = last_version_ + 1;
    last_version_ += static_cast<std::uint32_t>(count);
    return first;
  }

  /// Lifts a ball off all that it rests on.
  void lift(Slot slot) {
    if constexpr (kGravity) {
      resting[slot] = {};
      accelerations[slot] = gravity;
    }
  }

  void findWallVisit(Slot slot) {
    if (!walls.empty()) wall_visits[slot] = wallVisit(slot, bodies[slot]);
  }

  /// Sets all clocks back. @param by  s
  void setBack(Real by) {
    for (Body<Real>& body : bodies) body.time -= by;
    if (restitution < 1) {
      for (Card<Real>& card : cards) card.history.last -= by;
    }
    for (WallVisit<Real>& visit : wall_visits) visit.time -= by;
  }

 private:
  // Calls f with each array that has one entry a slot.
  template <class Function>
  void forEachArray(Function f) {
    f(bodies);
    f(cards);
    if constexpr (kGravity) {
      f(accelerations);
      f(resting);
    }
    if (!walls.empty()) f(wall_visits);
  }

  // The same on a straight path: timeToWall() without branches, as which walls a ball flies to is
  // anybody's guess.
  WallVisit<Real> straightWallVisit(const Body<Real>& body) const {
    WallVisit<Real> visit;
    for (std::size_t k = 0; k < walls.size(); ++k) {
      const Wall<Real>& wall = walls[k];
      const Real gap = dot(body.x, wall.normal) - wall.offset - body.radius;
      const Real approach = std::max(Real(0), -dot(body.v, wall.normal));
      const Real time = body.time + std::max(Real(0), gap) / approach;  // inf or NaN: never
      const bool is_sooner = time < visit.time;
      visit.wall = is_sooner ? static_cast<std::uint32_t>(k) : visit.wall;
      visit.time = is_sooner ? time : visit.time;
    }
    return visit;
  }

  std::uint32_t last_version_ = 0;        // given to a ball
  std::vector<std::vector<bool>> moved_;  // by thread and slot
};

}  // namespace ball_sim::core::continuous
