// Method brute_force: all pairs, every time; slow and obviously right. The twin that the fast
// methods are tested against, in any arithmetic.
//
// Each step finds the earliest impact of all pairs and all walls, moves every ball there, resolves
// it, and begins anew: no queue, no cells, nothing remembered. Exact to rounding, O(N^2) an event;
// for up to a few hundred balls. Impacts at one instant that share balls: see
// simultaneous_impacts.hpp.
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
#include "ball_sim/scene.hpp"
#include "ball_sim/simultaneous_impacts.hpp"
#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/walls.hpp"

namespace ball_sim::core {

/// @tparam Real  any floating-point type with sqrt and conversions to and from double
template <class Real>
class BruteForce final : public Method {
  using Vec = VectorOf<Real>;

 public:
  explicit BruteForce(const Surroundings& surroundings,
                      SimultaneousImpacts policy = SimultaneousImpacts::sequential)
      : surroundings_(surroundings),
        policy_(policy),
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
        if (policy_ == SimultaneousImpacts::sequential || !resolveTogether(event)) resolve(event);
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
    forEachImage(a, b, [&](const Vec& image) {
      const Real dt = pairTime(bodies_[a], bodies_[b], image);
      if (dt < first.dt) first = {dt, a, b, false, image};
    });
  }

  // Calls f with the way from a to the nearest image of b, and to those around it.
  template <class Function>
  void forEachImage(std::size_t a, std::size_t b, Function f) const {
    const Vec nearest = nearestImage(bodies_[b].x - bodies_[a].x);
    const int reach_x = periodicAxes() > 0 ? 1 : 0;
    const int reach_z = periodicAxes() > 2 ? 1 : 0;
    for (int i = -reach_x; i <= reach_x; ++i) {
      for (int j = -reach_x; j <= reach_x; ++j) {
        for (int k = -reach_z; k <= reach_z; ++k) {
          Vec image = nearest;
          if (i != 0) image[0] += i * edge(0);
          if (j != 0) image[1] += j * edge(1);
          if (k != 0) image[2] += k * edge(2);
          f(image);
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
    watch_.setBack(passed);
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
    watch({a.id, a.v, a.w, passed.change1}, {b.id, b.v, b.w, passed.change2}, n, speed, reach);
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
    const Vec at_rest = Vec::Zero();
    watch({body.id, body.v, body.w, (1 + e) * speed},
          {OrderWatch<Real>::wallKey(static_cast<std::size_t>(index)), at_rest, 0, 0}, -wall.normal,
          speed, body.radius);
    report(body, wall.partner, -wall.normal, (1 + e) * speed / body.w, speed);
  }

  void watch(const typename OrderWatch<Real>::Side& a, const typename OrderWatch<Real>::Side& b,
             const Vec& normal, Real speed, Real reach) {
    const Real e = Real(surroundings_.restitution);
    if (watch_.note(elapsed_, a, b, normal, speed, reach, e)) ++statistics_.ambiguous_impacts;
  }

  // --- policy `simultaneous`

  // A cluster: balls that touch each other or through others, at this instant.
  struct Cluster {
    std::vector<std::size_t> members;  // indices into bodies_, ascending
    std::vector<ClusterBody<Real>> bodies;
    std::vector<ClusterContact<Real>> contacts;  // by bodies
  };

  // One round of joint reflections of the cluster around an impact.
  // @return false: nothing else approaches there, and the impact is one like others
  bool resolveTogether(const Event& event) {
    Cluster cluster = clusterAround(event);
    keepApproaching(cluster.bodies, cluster.contacts);
    if (cluster.contacts.size() < 2) return false;
    const Real e = recordImpacts(cluster) ? Real(1) : Real(surroundings_.restitution);
    if (orderMatters<Real>(cluster.bodies, cluster.contacts, gravity_,
                           Real(surroundings_.restitution))) {
      ++statistics_.ambiguous_impacts;
    }
    reflectTogether(cluster.bodies, cluster.contacts, e);
    for (std::size_t i = 0; i < cluster.members.size(); ++i) {
      bodies_[cluster.members[i]].v = cluster.bodies[i].v;
    }
    for (const ClusterContact<Real>& contact : cluster.contacts) conclude(cluster, contact);
    for (const std::size_t member : cluster.members) velocityChanged(bodies_[member]);
    return true;
  }

  Cluster clusterAround(const Event& event) const {
    Cluster cluster;
    std::vector<std::size_t>& members = cluster.members;
    std::vector<bool> is_member(bodies_.size(), false);
    const auto join = [&](std::size_t index) {
      if (!is_member[index]) members.push_back(index);
      is_member[index] = true;
    };
    join(event.a);
    if (!event.with_wall) join(event.b);
    for (std::size_t k = 0; k < members.size(); ++k) {
      const std::size_t a = members[k];
      if (bodies_[a].w == 0) continue;  // a fixed ball hands nothing on
      for (std::size_t b = 0; b < bodies_.size(); ++b) {
        if (!is_member[b] && touching(a, b)) join(b);
      }
    }
    std::sort(members.begin(), members.end());
    for (const std::size_t member : members) {
      cluster.bodies.push_back({bodies_[member].v, bodies_[member].w});
    }
    addContacts(cluster);
    return cluster;
  }

  bool touching(std::size_t a, std::size_t b) const {
    bool found = false;
    forEachTouching(a, b, [&](const Vec&, Real) { found = true; });
    return found;
  }

  // Calls f with the way from a to each image of b that it touches, and the gap.
  template <class Function>
  void forEachTouching(std::size_t a, std::size_t b, Function f) const {
    using std::sqrt;
    const Real reach = bodies_[a].radius + bodies_[b].radius;
    const Real extent = std::max(extentOf(bodies_[a]), extentOf(bodies_[b]));
    forEachImage(a, b, [&](const Vec& dx) {
      const Real gap = sqrt(dot(dx, dx)) - reach;
      if (touches(gap, reach, extent)) f(dx, gap);
    });
  }

  // What a ball's place was last computed from: where it is, and how far it may have come.
  Real extentOf(const Body& body) const {
    return body.x.cwiseAbs().maxCoeff() + speedOf(body) * elapsed_;
  }

  void addContacts(Cluster& cluster) const {
    for (std::size_t i = 0; i < cluster.members.size(); ++i) {
      const Body& a = bodies_[cluster.members[i]];
      for (std::size_t k = 0; k < walls_.size(); ++k) {
        const Real gap = dot(a.x, walls_[k].normal) - walls_[k].offset - a.radius;
        if (a.w == 0 || !touches(gap, a.radius, extentOf(a))) continue;
        ClusterContact<Real> contact;
        contact.a = i;
        contact.wall = k;
        contact.normal = -walls_[k].normal;
        contact.gap = gap;
        contact.reach = a.radius;
        cluster.contacts.push_back(contact);
      }
      for (std::size_t j = i + 1; j < cluster.members.size(); ++j) {
        const Body& b = bodies_[cluster.members[j]];
        if (a.w == 0 && b.w == 0) continue;
        forEachTouching(cluster.members[i], cluster.members[j], [&](const Vec& dx, Real gap) {
          ClusterContact<Real> contact;
          contact.a = i;
          contact.b = j;
          contact.normal = contactNormal<Real>(dx);
          contact.gap = gap;
          contact.reach = a.radius + b.radius;
          contact.least_rebound =
              leastRebound<Real>(dot(Vec(a.a - b.a), contact.normal), contact.reach);
          cluster.contacts.push_back(contact);
        });
      }
    }
  }

  // Tells the guard against collapse, once a ball, by its fastest contact. @return whether any ball
  // is in a collapse
  bool recordImpacts(const Cluster& cluster) {
    if (surroundings_.restitution == 1) return false;
    bool collapses = false;
    for (std::size_t i = 0; i < cluster.members.size(); ++i) {
      Body& body = bodies_[cluster.members[i]];
      Real speed = 0;
      Real reach = 0;
      for (const ClusterContact<Real>& contact : cluster.contacts) {
        if (contact.a != i && contact.b != i) continue;
        if (contact.withWall() && dot(body.a, contact.normal) > 0) continue;  // it comes to rest
        if (contact.approach_speed > speed) {
          speed = contact.approach_speed;
          reach = contact.reach;
        }
      }
      if (speed > 0 && body.history.record(elapsed_, speed, reach)) collapses = true;
    }
    return collapses;
  }

  // Counts and reports a contact after its impact.
  void conclude(const Cluster& cluster, const ClusterContact<Real>& contact) {
    if (!(contact.impulse > 0)) return;
    Body& a = bodies_[cluster.members[contact.a]];
    noteOverlap(-contact.gap);
    if (contact.withWall()) {
      const Wall<Real>& wall = walls_[contact.wall];
      if (comesToRest<Real>(dot(a.v, wall.normal), dot(a.a, wall.normal), a.radius)) {
        a.resting.add(static_cast<int>(contact.wall));
      }
      ++statistics_.wall_collisions;
      report(a, wall.partner, contact.normal, contact.impulse, contact.approach_speed);
    } else {
      ++statistics_.ball_collisions;
      statistics_.virial += double(contact.impulse * contact.reach);
      report(a, static_cast<Partner>(bodies_[cluster.members[contact.b]].id), contact.normal,
             contact.impulse, contact.approach_speed);
    }
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
  SimultaneousImpacts policy_;
  Vec gravity_;
  std::vector<Wall<Real>> walls_;
  std::vector<Body> bodies_;  // ids ascending
  Time base_;                 // now() is base_ + elapsed_
  Real elapsed_ = 0;          // s
  OrderWatch<Real> watch_{surroundings_.gravity};
  Statistics statistics_;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
