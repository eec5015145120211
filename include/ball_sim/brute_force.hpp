// Method brute_force: all pairs, every time; slow and obviously right. The twin that the fast
// methods are tested against, in any arithmetic.
//
// Each step finds the earliest impact of all pairs and all walls, moves every ball there, resolves
// it, and begins anew: no queue, no cells, nothing remembered. Exact to rounding, O(N^2) an event;
// for up to a few hundred balls.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "ball_sim/collapse_guard.hpp"
#include "ball_sim/collision_law.hpp"
#include "ball_sim/method.hpp"
#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/walls.hpp"

namespace ball_sim::core {

/// @tparam Real  any floating-point type with sqrt and conversions to and from double
template <class Real>
class BruteForce final : public Method {
  using Vec = VectorOf<Real>;

 public:
  explicit BruteForce(const Surroundings& surroundings)
      : surroundings_(surroundings),
        gravity_(surroundings.gravity.cast<Real>()),
        walls_(wallsOf<Real>(surroundings)) {}

  const char* name() const override { return "brute_force"; }

  void insert(BallId id, const Ball& ball) override {
    assert(bodies_.empty() || bodies_.back().id < id);
    Body body;
    body.id = id;
    body.x = ball.position.cast<Real>();
    body.v = ball.velocity.cast<Real>();
    body.radius = Real(ball.radius);
    body.mass = ball.mass;
    body.w = std::isinf(ball.mass) ? Real(0) : Real(1) / Real(ball.mass);
    body.a = body.w > 0 ? gravity_ : Vec(Vec::Zero());
    wrap(body);
    bodies_.push_back(body);
  }

  void remove(BallId id) override { bodies_.erase(bodies_.begin() + (find(id) - bodies_.begin())); }

  void setMotion(BallId id, const Vector3& position, const Vector3& velocity) override {
    Body& body = *find(id);
    body.x = position.cast<Real>();
    wrap(body);
    body.resting = {};
    body.a = gravity_;
    setVelocity(id, velocity);
  }

  void setVelocity(BallId id, const Vector3& velocity) override {
    Body& body = *find(id);
    body.v = velocity.cast<Real>();
    velocityChanged(body);
  }

  bool advanceTo(Time target, std::uint64_t max_events) override {
    while (true) {
      const Real left = Real(target - base_) - elapsed_;
      const Event event = earliest();
      const Real stride = longestStride();
      if (event.dt > left && left <= stride) {
        move(left);
        restartClock(target);
        return true;
      }
      if (max_events == 0) return false;
      --max_events;
      ++statistics_.events;
      if (event.dt > stride) {
        advance(stride);  // only so far are the images of a periodic box looked at
      } else {
        advance(event.dt);
        resolve(event);
      }
      if (elapsed_ > 1) restartClock(now());
    }
  }
  using Method::advanceTo;

  Time now() const override { return base_ + double(elapsed_); }

  void read(BallStates& states) const override {
    states.time = now();
    states.ids.clear();
    states.positions.clear();
    states.velocities.clear();
    for (const Body& body : bodies_) {
      states.ids.push_back(body.id);
      states.positions.push_back(body.x.template cast<double>());
      states.velocities.push_back(body.v.template cast<double>());
    }
  }

  Ball ball(BallId id) const override {
    const Body& body = *find(id);
    return {body.x.template cast<double>(), body.v.template cast<double>(), double(body.radius),
            body.mass};
  }

  std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                    std::optional<BallId> ignore) const override {
    for (const Body& body : bodies_) {
      if (body.id == ignore) continue;
      const Vec dx = nearestImage(body.x - position.cast<Real>());
      const Real reach = (body.radius + Real(radius)) * (1 - Real(1e-12));
      if (dot(dx, dx) < reach * reach) return body.id;
    }
    return std::nullopt;
  }

  Statistics statistics() const override {
    Statistics statistics = statistics_;
    statistics.bytes = bodies_.capacity() * sizeof(Body);
    return statistics;
  }

  void setCollisionLog(CollisionLog* log) override { log_ = log; }

 private:
  static constexpr BallId kNobody = ~BallId{0};

  struct Body {
    BallId id = 0;
    BallId last_partner = kNobody;  // of the last impact, when no other change came after
    Vec last_normal = Vec::Zero();  // from the smaller id to the larger, of that impact
    Vec x, v, a;                    // m, m/s, m/s^2, at the present instant
    Real radius, w;                 // m, 1/kg
    double mass = 0;                // kg
    ImpactHistory<Real> history;    // on the clock elapsed_
    RestingContacts resting;
  };

  struct Event {
    Real dt = kNever<Real>;  // s from now
    std::size_t a = 0;       // index of the ball
    std::size_t b = 0;       // index of the other ball, or of the wall
    bool with_wall = false;
    Vec image = Vec::Zero();  // from a to the image of b that it meets, as of now, m
  };

  typename std::vector<Body>::iterator find(BallId id) {
    return std::lower_bound(bodies_.begin(), bodies_.end(), id,
                            [](const Body& body, BallId other) { return body.id < other; });
  }
  typename std::vector<Body>::const_iterator find(BallId id) const {
    return const_cast<BruteForce*>(this)->find(id);
  }

  Real edge(int axis) const {
    return Real(surroundings_.box.max[axis]) - Real(surroundings_.box.min[axis]);
  }
  int periodicAxes() const { return surroundings_.periodic ? (surroundings_.planar() ? 2 : 3) : 0; }

  void wrap(Body& body) const {
    using std::floor;
    for (int axis = 0; axis < periodicAxes(); ++axis) {
      const Real from_min = body.x[axis] - Real(surroundings_.box.min[axis]);
      body.x[axis] -= floor(from_min / edge(axis)) * edge(axis);
    }
  }

  Vec nearestImage(const Vec& dx) const { return imageNear(dx, Vec::Zero()); }

  // The image of dx that lies nearest to `expected`.
  Vec imageNear(Vec dx, const Vec& expected) const {
    using std::floor;
    for (int axis = 0; axis < periodicAxes(); ++axis) {
      dx[axis] -= floor((dx[axis] - expected[axis]) / edge(axis) + Real(0.5)) * edge(axis);
    }
    return dx;
  }

  // In a periodic box the nearest image and its neighbours are looked at; within this time no ball
  // goes further than a quarter of the box, and no other image can come near.
  Real longestStride() const {
    using std::sqrt;
    if (!surroundings_.periodic) return kNever<Real>;
    Real shortest = edge(0);
    for (int axis = 1; axis < periodicAxes(); ++axis) shortest = std::min(shortest, edge(axis));
    Real stride = kNever<Real>;
    for (const Body& body : bodies_) {  // v t + a t^2 / 2 = shortest / 4
      const Real v = speedOf(body);
      const Real pace = v + sqrt(v * v + sqrt(dot(body.a, body.a)) * (shortest / 2));
      if (pace > 0) stride = std::min(stride, Real(shortest / (2 * pace)));
    }
    return stride;
  }

  Event earliest() const {
    Event first;
    for (std::size_t a = 0; a < bodies_.size(); ++a) {
      for (std::size_t k = 0; k < walls_.size(); ++k) {
        const Real dt = wallTime(bodies_[a], k);
        if (dt < first.dt) first = {dt, a, k, true, Vec::Zero()};
      }
      for (std::size_t b = a + 1; b < bodies_.size(); ++b) considerPair(a, b, first);
    }
    return first;
  }

  Real wallTime(const Body& body, std::size_t k) const {
    if (body.w == 0 || body.resting.includes(static_cast<int>(k))) return kNever<Real>;
    const Wall<Real>& wall = walls_[k];
    return timeToWall<Real>(dot(body.x, wall.normal) - wall.offset - body.radius,
                            dot(body.v, wall.normal), dot(body.a, wall.normal));
  }

  void considerPair(std::size_t a, std::size_t b, Event& first) const {
    if (bodies_[a].w == 0 && bodies_[b].w == 0) return;
    const Vec dx = bodies_[b].x - bodies_[a].x;
    const Vec nearest = nearestImage(dx);
    const int reach_x = periodicAxes() > 0 ? 1 : 0;
    const int reach_z = periodicAxes() > 2 ? 1 : 0;
    for (int i = -reach_x; i <= reach_x; ++i) {
      for (int j = -reach_x; j <= reach_x; ++j) {
        for (int k = -reach_z; k <= reach_z; ++k) {
          Vec image = nearest;
          if (i != 0) image[0] += i * edge(0);
          if (j != 0) image[1] += j * edge(1);
          if (k != 0) image[2] += k * edge(2);
          const Real dt = pairTime(bodies_[a], bodies_[b], image);
          if (dt < first.dt) first = {dt, a, b, false, image};
        }
      }
    }
  }

  Real pairTime(const Body& a, const Body& b, const Vec& dx) const {
    const Real reach = a.radius + b.radius;
    const Vec dv = b.v - a.v;
    const Vec da = b.a - a.a;
    if (dot(da, da) > 0) return timeOfImpactAccelerated<Real>(dx, dv, da, reach);
    // In straight relative motion two balls that have just met do not meet again, unless it is
    // another image that comes from another side.
    const bool just_met = a.last_partner == b.id && b.last_partner == a.id;
    const Real squared = dot(dx, dx);
    if (just_met && squared < reach * reach * Real(1 + 1e-6) &&
        dot(dx, a.last_normal) > Real(0.9) * reach) {
      return kNever<Real>;
    }
    return timeOfImpact<Real>(dx, dv, reach);
  }

  void move(Real dt) {
    for (Body& body : bodies_) {
      body.x += dt * (body.v + (dt / 2) * body.a);
      body.v += dt * body.a;
      wrap(body);
    }
  }

  void advance(Real dt) {
    move(dt);
    elapsed_ += dt;
  }

  // The clock starts at 0 again, so that it stays fine however long the run is.
  void restartClock(Time now) {
    const Real passed = Real(now - base_);
    for (Body& body : bodies_) body.history.last -= passed;
    base_ = now;
    elapsed_ = 0;
  }

  void resolve(const Event& event) {
    if (event.with_wall) {
      resolveWall(bodies_[event.a], static_cast<int>(event.b));
    } else {
      Body& a = bodies_[event.a];
      Body& b = bodies_[event.b];
      const Vec dv = (b.v - a.v) - (event.dt / 2) * (b.a - a.a);  // the mean over the flight
      resolvePair(a, b, imageNear(b.x - a.x, event.image + event.dt * dv));
    }
  }

  // `dx`: from a to the image of b that it meets.
  void resolvePair(Body& a, Body& b, const Vec& dx) {
    const Vec n = contactNormal<Real>(dx);
    const Real reach = a.radius + b.radius;
    const Real speed = dot(a.v, n) - dot(b.v, n);
    Real e = Real(surroundings_.restitution);
    const Real least = leastRebound<Real>(dot(Vec(a.a - b.a), n), reach);
    if (e < 1) {
      const bool a_collapses = a.history.record(elapsed_, speed, reach);
      const bool b_collapses = b.history.record(elapsed_, speed, reach);
      if (a_collapses || b_collapses) e = 1;
    }
    const Exchange<Real> passed = collide<Real>(a.v, a.w, b.v, b.w, n, e, least);
    velocityChanged(a);
    velocityChanged(b);
    a.last_partner = b.id;
    b.last_partner = a.id;
    a.last_normal = b.last_normal = n;
    if (!(passed.impulse > 0)) return;
    ++statistics_.ball_collisions;
    statistics_.virial += double(passed.impulse * reach);
    noteOverlap(reach - dot(dx, n));
    report(a, static_cast<Partner>(b.id), n, passed.impulse, passed.approach_speed);
  }

  void resolveWall(Body& body, int index) {
    const Wall<Real>& wall = walls_[static_cast<std::size_t>(index)];
    const Real pull = dot(body.a, wall.normal);
    const Real speed = -dot(body.v, wall.normal);
    Real e = Real(surroundings_.restitution);
    if (e < 1 && !(pull < 0) && body.history.record(elapsed_, speed, body.radius)) e = 1;
    noteOverlap(wall.offset + body.radius - dot(body.x, wall.normal));
    collideWithWall<Real>(body.v, wall.normal, e);
    if (comesToRest<Real>(dot(body.v, wall.normal), pull, body.radius)) body.resting.add(index);
    velocityChanged(body);
    if (!(speed > 0)) return;
    ++statistics_.wall_collisions;
    report(body, wall.partner, -wall.normal, (1 + e) * speed / body.w, speed);
  }

  static Real speedOf(const Body& body) {
    using std::sqrt;
    return sqrt(dot(body.v, body.v));
  }

  // After any change of velocity: forget the partner, leave or keep the walls rested on.
  void velocityChanged(Body& body) {
    body.last_partner = kNobody;
    if (body.resting.count == 0) return;
    body.a = settleContacts<Real>(body.resting, body.v, body.radius, gravity_, walls_);
  }

  void noteOverlap(Real overlap) {
    statistics_.deepest_overlap = std::max(statistics_.deepest_overlap, double(overlap));
  }

  void report(const Body& a, Partner b, const Vec& n, Real impulse, Real speed) {
    if (log_ == nullptr) return;
    Collision collision;
    collision.time = now();
    collision.a = a.id;
    collision.b = b;
    collision.point = Vec(a.x + a.radius * n).template cast<double>();
    collision.normal = n.template cast<double>();
    collision.impulse = double(impulse);
    collision.approach_speed = double(speed);
    log_->add(collision);
  }

  Surroundings surroundings_;
  Vec gravity_;
  std::vector<Wall<Real>> walls_;
  std::vector<Body> bodies_;  // ids ascending
  Time base_;                 // now() is base_ + elapsed_
  Real elapsed_ = 0;          // s
  Statistics statistics_;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
