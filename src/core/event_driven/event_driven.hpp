// Method event_driven: hard-sphere event-driven dynamics. Nothing happens between impacts, so only
// impacts are computed, in order of time, each exact to rounding.
//
// Every ball holds its own next event (an impact with a ball or wall, or the way out of its cell)
// and sits once in the queue. An impact found with a partner that has meanwhile changed is noticed
// when it comes up (the partner's version tells) and searched again.
//
//   flights.hpp           the balls: on what flight each is, and its agenda
//   neighbourhood.hpp     who is near whom: cells (cell_grid.hpp) or lists (neighbour_lists.hpp)
//   impact_search.hpp     a ball's next impact
//   way_out.hpp           when it leaves its cell, or the region around its home
//   event_queue.hpp       whose event comes first
//   memory_order.hpp      where in memory a ball is best kept
//   touching_cluster.hpp  who touches whom, where impacts of one instant are taken together
//
// Gets right: everything hard and elastic or dissipative, any masses and radii, walls, gravity,
// at any speed: no impact is missed, none is seen twice. Misses: contact that lasts. A ball comes
// to rest on walls; a ball on another ball keeps bouncing, ever lower, down to a hum of 1e-6 of
// their radii. Impacts at one instant are taken one after the other, by the smaller ids first, or
// together (simultaneous_impacts.hpp).
// Limits: 2^27 balls; 2^30 cells from the origin of an open scene.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "ball_sim/method.hpp"
#include "ball_sim/scene.hpp"
#include "ball_sim/simultaneous_impacts.hpp"
#include "ball_sim/walls.hpp"
#include "event_driven/event_queue.hpp"
#include "event_driven/flights.hpp"
#include "event_driven/impact_search.hpp"
#include "event_driven/memory_order.hpp"
#include "event_driven/neighbourhood.hpp"
#include "event_driven/periodic_space.hpp"
#include "event_driven/touching_cluster.hpp"
#include "event_driven/way_out.hpp"
#include "fetch_ahead.hpp"
#include "impact.hpp"

namespace ball_sim::core {

/// @tparam Real      double or long double
/// @tparam kGravity  whether balls fall; without it no acceleration is stored or computed
template <class Real, bool kGravity>
class EventDriven final : public Method {
  using Vec = VectorOf<Real>;
  using Met = JustMet<Real>;

 public:
  explicit EventDriven(const Surroundings& surroundings,
                       SimultaneousImpacts policy = SimultaneousImpacts::sequential)
      : surroundings_(surroundings),
        policy_(policy),
        restitution_(Real(surroundings.restitution)),
        walls_(wallsOf<Real>(surroundings)),
        space_(surroundings),
        flights_(surroundings),
        impacts_(flights_, space_, walls_),
        queue_(flights_.agendas, GoesFirst{this}) {}

  const char* name() const override { return "event_driven"; }

  void insert(BallId id, const Ball& ball) override {
    assert(slots_.empty() || agenda(slots_.back()).id < id);
    const Slot slot = takeSlot();
    agenda(slot).mass = ball.mass;
    agenda(slot).id = id;
    slots_.push_back(slot);
    if (flights_.keeps_histories) flights_.histories[slot] = {};
    put(slot, ball.position, ball.velocity, Real(ball.radius));
    if (slots_.size() > 2 * balls_at_layout_ + 16 || !neighbourhood_.fits(Real(ball.radius))) {
      ready_ = false;
    }
    if (ready_) settleIn(slot);
  }

  void remove(BallId id) override {
    const auto found = find(id);
    const Slot slot = *found;
    if (ready_) {
      lift(slot);
      neighbourhood_.forget(slot);
    }
    if constexpr (kGravity) flights_.contacts.release(slot, flights_.isFixed(slot));
    ++agenda(slot).version;
    slots_.erase(found);
    agenda(slot).next = std::exchange(free_slot_, slot);
  }

  void setMotion(BallId id, const Vector3& position, const Vector3& velocity) override {
    const Slot slot = *find(id);
    if (ready_) lift(slot);
    put(slot, position, velocity, body(slot).radius);
    if (ready_) settleIn(slot);
  }

  void setVelocity(BallId id, const Vector3& velocity) override {
    const Slot slot = *find(id);
    flights_.settle(slot);
    body(slot).v = velocity.cast<Real>();
    velocityChanged(slot);
    if (ready_) {
      queue_.remove(slot);
      search(slot);
    }
  }

  bool advanceTo(Time target, std::uint64_t max_events) override {
    while (true) {
      if (!ready_) layOut();
      const Real limit = Real(target - origin_);
      while (queue_.isDue(limit, expectation())) {
        if (max_events-- == 0) {
          reached_ = origin_ + double(flights_.now);
          return false;
        }
        const auto due = queue_.pop();
        flights_.now = std::max(flights_.now, due.time);
        ++statistics_.events;
        handle(due.slot);
      }
      if (limit < queue_.yearLength()) {
        flights_.now = limit;
        reached_ = target;
        return true;
      }
      turnYear(limit);
    }
  }
  using Method::advanceTo;

  Time now() const override { return reached_; }

  void read(BallStates& states) const override {
    states.time = now();
    states.ids.resize(slots_.size());
    states.positions.resize(slots_.size());
    states.velocities.resize(slots_.size());
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const Slot slot = slots_[i];
      states.ids[i] = agenda(slot).id;
      states.positions[i] = positionInBox(slot);
      states.velocities[i] = flights_.velocity(slot).template cast<double>();
    }
  }

  Ball ball(BallId id) const override {
    const Slot slot = *find(id);
    return {positionInBox(slot), flights_.velocity(slot).template cast<double>(),
            double(body(slot).radius), agenda(slot).mass};
  }

  std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                    std::optional<BallId> ignore) const override {
    std::optional<BallId> found;
    for (const Slot slot : slots_) {
      const BallId id = agenda(slot).id;
      if (id == ignore || (found && *found < id)) continue;
      const Vec dx = space_.nearestImage(flights_.position(slot) - position.cast<Real>());
      const Real reach = (body(slot).radius + Real(radius)) * (1 - Real(1e-12));
      if (dot(dx, dx) < reach * reach) found = id;
    }
    return found;
  }

  Statistics statistics() const override {
    Statistics statistics = statistics_;
    statistics.queue_depth = slots_.size();
    statistics.bytes = flights_.bytes() + neighbourhood_.bytes() + queue_.bytes() +
                       memory_order_.bytes() + capacityBytes(slots_);
    return statistics;
  }

  void setCollisionLog(CollisionLog* log) override { log_ = log; }

 private:
  // --- balls, by id and slot

  Body<Real>& body(Slot slot) { return flights_.bodies[slot]; }
  const Body<Real>& body(Slot slot) const { return flights_.bodies[slot]; }
  Agenda<Real>& agenda(Slot slot) { return flights_.agendas[slot]; }
  const Agenda<Real>& agenda(Slot slot) const { return flights_.agendas[slot]; }

  std::vector<Slot>::iterator find(BallId id) {
    return std::lower_bound(slots_.begin(), slots_.end(), id,
                            [this](Slot slot, BallId other) { return agenda(slot).id < other; });
  }
  std::vector<Slot>::const_iterator find(BallId id) const {
    return const_cast<EventDriven*>(this)->find(id);
  }

  Slot takeSlot() {
    if (free_slot_ != kNoSlot) {
      return std::exchange(free_slot_, agenda(free_slot_).next);
    }
    const std::size_t count = flights_.size() + 1;
    flights_.resize(count);
    neighbourhood_.resize(count);
    return static_cast<Slot>(count - 1);
  }

  // Puts a ball on another flight, wherever it was; it touches nothing.
  void put(Slot slot, const Vector3& position, const Vector3& velocity, Real radius) {
    body(slot) = {position.cast<Real>(), velocity.cast<Real>(), flights_.now, radius};
    ++agenda(slot).version;
    if constexpr (kGravity) flights_.contacts.release(slot, flights_.isFixed(slot));
  }

  Vector3 positionInBox(Slot slot) const {
    return space_.wrapped(flights_.position(slot)).template cast<double>();
  }

  // Of events at one instant the one with the smaller of its two ids goes first, then by the other
  // id, where a wall comes before all balls.
  struct GoesFirst {
    const EventDriven* method;
    bool operator()(Slot a, Slot b) const { return method->rank(a) < method->rank(b); }
  };

  std::tuple<BallId, Partner, Slot> rank(Slot slot) const {
    const Agenda<Real>& own = agenda(slot);
    if (own.crossesFirst()) return {own.id, own.id, slot};
    if (own.partner >= kWall) return {own.id, walls_[own.partner - kWall].partner, slot};
    const BallId other = agenda(own.partner).id;
    return {std::min(own.id, other), std::max(own.id, other), slot};
  }

  // Fetches from memory what balls that come up soon will need: the second step needs what the
  // first has fetched.
  auto expectation() {
    return [this](Slot slot, std::uint32_t buckets_ahead) {
      const Agenda<Real>& own = agenda(slot);
      const bool crosses = own.crossesFirst();
      const bool meets = !crosses && own.partner < kWall;
      const bool listed = neighbourhood_.listed();
      if (buckets_ahead == EventQueue<Real, GoesFirst>::kSoon) {
        fetchAhead(&body(slot));
        neighbourhood_.fetchList(slot);
        crosses ? neighbourhood_.fetchCellsToCross(own) : neighbourhood_.fetchCells(own);
        if (!meets) return;
        fetchAhead(&body(own.partner));
        fetchAhead(&agenda(own.partner));
        neighbourhood_.fetchList(own.partner);
      } else if (crosses && listed) {
        neighbourhood_.fetchHomes(own);
      } else if (crosses) {
        fetchBodies(neighbourhood_.foreseeNewcomers(own));
      } else {
        fetchBodies(nearTo(slot));
        // In cells the partner's are mostly the same, and dear to find.
        if (meets && listed) fetchBodies(nearTo(own.partner));
      }
    };
  }

  void fetchBodies(const Near& near) const {
    for (std::size_t i = 0; i < near.count; ++i) fetchAhead(&body(near.slots[i]));
  }

  Near nearTo(Slot slot) { return neighbourhood_.near(slot, agenda(slot)); }

  // --- layout, and the calendar

  // Cuts space, and finds every ball's next event, for the balls as they are now.
  void layOut() {
    for (const Slot slot : slots_) bringHome(slot);
    // Before memory is given back: what is taken from that again is not in huge pages.
    cutSpace();
    sortAlongCurve();
    flights_.shrink();
    slots_.shrink_to_fit();
    for (const Slot slot : slots_) place(slot);
    neighbourhood_.fillLists(slots_, flights_.agendas);
    balls_at_layout_ = slots_.size();
    crossings_when_sorted_ = crossings_;
    ready_ = true;
    for (const Slot slot : slots_) findNextEvent(slot);
    setCalendar(estimatedEventRate());
  }

  void cutSpace() {
    std::vector<GridBall<Real>> balls;
    balls.reserve(slots_.size());
    for (const Slot slot : slots_) balls.push_back({flights_.position(slot), body(slot).radius});
    neighbourhood_.layOut(surroundings_, balls);
    const bool nearest = neighbourhood_.nearestSuffices();
    space_.setNearestSuffices(nearest);
    impacts_.choose(surroundings_.periodic && nearest,
                    neighbourhood_.listed() ? kSearchStep : kLanesForFew);
  }

  // Gives the balls new slots along a space-filling curve, and none to those that are gone. What
  // was found stays found; the queue has to be filled anew.
  //
  // Nothing is allocated: meanwhile slots_ is the permutation, and balls have their places in it
  // in their agendas, where the queue had its links.
  void sortAlongCurve() {
    const std::size_t balls = slots_.size();
    for (; free_slot_ != kNoSlot; free_slot_ = agenda(free_slot_).next) {
      agenda(free_slot_).previous = kNotQueued;
    }
    for (std::size_t i = 0; i < balls; ++i) agenda(slots_[i]).previous = static_cast<Slot>(i);
    slots_.resize(flights_.size());
    memory_order_.number([this](Slot slot) { return flights_.position(slot); },
                         [this](Slot slot) { return isGone(slot); }, slots_);
    renamePartners(slots_);
    flights_.moveTo(slots_);
    flights_.resize(balls);
    if (ready_) neighbourhood_.renumber(slots_, flights_.agendas);
    slots_.resize(balls);
    for (Slot slot = 0; slot < balls; ++slot) slots_[agenda(slot).previous] = slot;
  }

  // While balls are sorted.
  bool isGone(Slot slot) const { return agenda(slot).previous == kNotQueued; }

  // @param to  the new slots, by those that were
  void renamePartners(const std::vector<Slot>& to) {
    for (Slot slot = 0; slot < flights_.size(); ++slot) {
      Agenda<Real>& own = agenda(slot);
      if (isGone(slot) || own.partner >= kWall) continue;
      if (agenda(own.partner).version == own.partner_version) {
        own.partner = to[own.partner];
      } else {  // stale, and so that it will be found to be so
        own.partner = to[slot];
        own.partner_version = own.version - 1;
      }
    }
  }

  // Events per second, from the times at which half of the balls have their next one. What happens
  // at once, as on a lattice laid just along the cells, tells nothing of what comes after.
  Real estimatedEventRate() const {
    Real longest = 0;
    const auto wait = [this](Slot slot) { return agenda(slot).due() - flights_.now; };
    for (const Slot slot : slots_) {
      if (wait(slot) < kNever<Real>) longest = std::max(longest, wait(slot));
    }
    std::vector<Real> waits;
    for (const Slot slot : slots_) {
      if (wait(slot) > Real(1e-9) * longest && wait(slot) <= longest) waits.push_back(wait(slot));
    }
    if (waits.empty()) return 0;
    const auto middle = waits.begin() + static_cast<std::ptrdiff_t>(waits.size() / 2);
    std::nth_element(waits.begin(), middle, waits.end());
    return Real(0.7) * Real(waits.size()) / *middle;
  }

  void setCalendar(Real events_per_second) {
    // The turn of the year costs the less the longer the year, until its buckets fill the caches.
    const Real events_per_ball = slots_.size() > kCachedBalls ? 1 : 3;
    std::uint32_t buckets = 8;
    while (Real(buckets) * kEventsPerBucket < events_per_ball * Real(slots_.size())) buckets *= 2;
    const Real width = events_per_second > 0 ? kEventsPerBucket / events_per_second : Real(1);
    // Clocks restart with the calendar.
    setClocksBack(flights_.now, kNever<Real>);
    queue_.reset(floorToThreeBits(width), buckets);
    for (const Slot slot : slots_) queue_.insert(slot);
    events_at_new_year_ = statistics_.events;
  }

  // Years of so few digits are taken from times without rounding.
  static Real floorToThreeBits(Real x) {
    int exponent = 0;
    using std::floor;
    using std::frexp;
    using std::ldexp;
    const Real fraction = frexp(x, &exponent);
    return ldexp(floor(8 * fraction), exponent - 3);
  }

  // @param oldest  see Flights::setBack()
  void setClocksBack(Real by, Real oldest) {
    if (by == 0) return;
    origin_ = origin_ + double(by);
    watch_.setBack(by);
    flights_.setBack(by, oldest);
  }

  // Moves all clocks back by whole years, to the next one in which anything happens.
  void turnYear(Real limit) {
    const Real year = queue_.yearLength();
    const Real next = std::min(limit, queue_.earliestBeyond());
    const Real years = std::max(Real(1), std::floor(next / year));
    flights_.now = years * year;
    setClocksBack(flights_.now, 32 * year);
    // Balls that have mixed lie at random in memory again, which matters beyond the caches.
    if (slots_.size() > kCachedBalls &&
        crossings_ - crossings_when_sorted_ > kCrossingsPerSorting * slots_.size()) {
      sortAlongCurve();
      crossings_when_sorted_ = crossings_;
      queue_.clear();
      for (Slot slot = 0; slot < flights_.size(); ++slot) queue_.insert(slot);
    } else {
      queue_.turnYear();
    }
    retuneCalendar(years);
  }

  void retuneCalendar(Real years) {
    const auto events = Real(statistics_.events - events_at_new_year_);
    events_at_new_year_ = statistics_.events;
    const Real per_bucket = events / (years * queue_.yearLength() / queue_.bucketWidth());
    const bool off = per_bucket > 2 * kEventsPerBucket || 2 * per_bucket < kEventsPerBucket;
    if (off && events > 0) setCalendar(per_bucket / queue_.bucketWidth());
  }

  void bringHome(Slot slot) { body(slot).x -= space_.wayHome(flights_.position(slot)); }

  // Puts a ball into the cell in which it is now.
  void place(Slot slot) {
    bringHome(slot);
    neighbourhood_.place(slot, flights_.position(slot), body(slot).radius, agenda(slot));
  }

  // Puts a ball that came while others fly among them.
  void settleIn(Slot slot) {
    place(slot);
    neighbourhood_.renewList(slot, agenda(slot));
    search(slot);
  }

  void lift(Slot slot) {
    queue_.remove(slot);
    neighbourhood_.lift(slot, agenda(slot));
  }

  // --- a ball's next event

  // Finds the next event of a ball that is not queued, and queues it.
  void search(Slot slot, const Met& met = {}) {
    findNextEvent(slot, met);
    queue_.insert(slot);
  }

  void findNextEvent(Slot slot, const Met& met = {}) {
    NextImpact<Real> next;
    impacts_.considerBalls(slot, met, nearTo(slot), next);
    impacts_.considerWalls(slot, next);
    setImpact(slot, next);
    findWayOut(slot);
  }

  void setImpact(Slot slot, const NextImpact<Real>& next) {
    Agenda<Real>& own = agenda(slot);
    own.impact_time = next.time;
    own.partner = next.partner;
    if (next.partner < kWall) own.partner_version = agenda(next.partner).version;
  }

  void findWayOut(Slot slot) {
    Agenda<Real>& own = agenda(slot);
    own.crossing_time = kNever<Real>;
    if (flights_.isFixed(slot)) return;
    const Vec x = flights_.position(slot);
    const Lattice<Real>& cubes = neighbourhood_.cubes(own);
    const CellCoordinates& cube = neighbourhood_.cube(slot, own);
    WayOut<Real> way;
    if constexpr (kGravity) {
      const Vec a = flights_.acceleration(slot);
      way = wayOutFalling<Real>(x, flights_.velocity(slot), a, cubes, cube);
    } else {
      way = wayOut<Real>(x, body(slot).v, cubes, cube);
    }
    own.crossing_time = flights_.now + way.wait;
    own.crossing_axis = way.axis;
    own.crossing_direction = way.direction;
  }

  // --- events

  void handle(Slot slot) {
    const Agenda<Real>& own = agenda(slot);
    if (own.crossesFirst()) {
      ++crossings_;
      neighbourhood_.listed() ? moveHouse(slot) : cross(slot);
    } else if (own.partner >= kWall) {
      meetWall(slot, own.partner - kWall);
    } else if (agenda(own.partner).version == own.partner_version) {
      meetBall(slot, own.partner);
    } else {
      search(slot);
    }
  }

  // Out of its region: a new home, and a new list.
  void moveHouse(Slot slot) {
    lift(slot);
    settleIn(slot);
  }

  // Into the next cell: only the balls that came near by this are new.
  void cross(Slot slot) {
    Agenda<Real>& own = agenda(slot);
    const int turns = neighbourhood_.cross(slot, own);
    if (turns != 0) {  // out of the periodic box, and in again on the other side
      body(slot).x[own.crossing_axis] -= Real(turns) * space_.period()[own.crossing_axis];
    }
    if (!space_.nearestSuffices()) return search(slot);  // other images are in reach now, too
    NextImpact<Real> next{own.impact_time, own.partner};
    impacts_.considerBalls(slot, {}, neighbourhood_.newcomers(own), next);
    if (next.time < own.impact_time) setImpact(slot, next);
    findWayOut(slot);
    queue_.insert(slot);
  }

  void meetBall(Slot first, Slot second) {
    if (policy_ == SimultaneousImpacts::simultaneous && meetTogether(first, second)) return;
    if (agenda(second).id < agenda(first).id) std::swap(first, second);
    flights_.settle(first);
    flights_.settle(second);
    Body<Real>& a = body(first);
    Body<Real>& b = body(second);
    const Real reach = a.radius + b.radius;
    const Vec dx = space_.contactVector(a, b, reach);
    const Vec pressing = flights_.acceleration(first) - flights_.acceleration(second);
    const auto impact = core::meetBall<Real>(dx, reach, pressing, restitution_, flights_.now,
                                             flights_.impacting(first), flights_.impacting(second));
    const Vec& n = impact.normal;
    const Exchange<Real>& passed = impact.exchange;
    if (passed.impulse > 0) {
      ++statistics_.ball_collisions;
      statistics_.virial += double(passed.impulse * reach);
      noteOverlap(impact.overlap);
      watch({agenda(first).id, a.v, flights_.inverseMass(first), passed.change1},
            {agenda(second).id, b.v, flights_.inverseMass(second), passed.change2}, n,
            passed.approach_speed, reach);
      report(first, agenda(second).id, n, passed.impulse, passed.approach_speed);
    }
    velocityChanged(first);
    velocityChanged(second);
    queue_.remove(first);
    queue_.remove(second);
    search(first, {second, n});
    search(second, {first, -n});
  }

  void meetWall(Slot slot, std::uint32_t index) {
    if (policy_ == SimultaneousImpacts::simultaneous && meetTogether(slot, kNoSlot)) return;
    flights_.settle(slot);
    Body<Real>& flight = body(slot);
    const Wall<Real>& wall = walls_[index];
    const Real pull = dot(flights_.acceleration(slot), wall.normal);
    const auto impact = core::meetWall<Real>(wall, flight.x, flight.radius, pull, restitution_,
                                             flights_.now, flights_.impacting(slot));
    noteOverlap(impact.overlap);
    if constexpr (kGravity) {
      if (impact.rests) flights_.contacts.rest(slot, static_cast<int>(index));
    }
    if (impact.speed > 0) {
      ++statistics_.wall_collisions;
      const Vec at_rest = Vec::Zero();
      const Real change = (1 + impact.restitution) * impact.speed;
      watch({agenda(slot).id, flight.v, flights_.inverseMass(slot), change},
            {OrderWatch<Real>::wallKey(index), at_rest, 0, 0}, -wall.normal, impact.speed,
            flight.radius);
      report(slot, wall.partner, -wall.normal, change * Real(agenda(slot).mass), impact.speed);
    }
    velocityChanged(slot);
    search(slot);
  }

  void watch(const typename OrderWatch<Real>::Side& a, const typename OrderWatch<Real>::Side& b,
             const Vec& normal, Real speed, Real reach) {
    if (watch_.note(flights_.now, a, b, normal, speed, reach, restitution_)) {
      ++statistics_.ambiguous_impacts;
    }
  }

  // --- policy `simultaneous`

  // One round of joint reflections of the cluster around an impact of `slot`, which is not queued.
  // @param other  the ball it meets, or kNoSlot
  // @return false: nothing else approaches there, and the impact is one like others
  bool meetTogether(Slot slot, Slot other) {
    TouchingCluster<Real> cluster =
        TouchSearch(flights_, space_, walls_, neighbourhood_).clusterAround(slot, other);
    keepApproaching(cluster.bodies, cluster.contacts);
    if (cluster.contacts.size() < 2) return false;
    if (orderMatters<Real>(cluster.bodies, cluster.contacts, space_.pairs().fall, restitution_)) {
      ++statistics_.ambiguous_impacts;
    }
    const Real e = recordImpacts(cluster) ? Real(1) : restitution_;
    reflectTogether(cluster.bodies, cluster.contacts, e);
    std::vector<bool> changed(cluster.members.size(), false);
    for (const ClusterContact<Real>& contact : cluster.contacts) {
      changed[contact.a] = true;
      if (!contact.withWall()) changed[contact.b] = true;
    }
    const auto forChanged = [&](auto f) {
      for (std::size_t i = 0; i < changed.size(); ++i) {
        if (changed[i]) f(cluster.members[i], cluster.bodies[i].v);
      }
    };
    forChanged([&](Slot member, const Vec& v) {
      flights_.settle(member);
      body(member).v = v;
      if (member != slot) queue_.remove(member);
    });
    for (const ClusterContact<Real>& contact : cluster.contacts) conclude(cluster, contact);
    forChanged([&](Slot member, const Vec&) { velocityChanged(member); });
    forChanged([&](Slot member, const Vec&) { search(member); });
    if (!changed[cluster.indexOf(slot)]) search(slot);
    return true;
  }

  // Tells the guard against collapse, once a ball, by its fastest contact. @return whether any ball
  // is in a collapse
  bool recordImpacts(const TouchingCluster<Real>& cluster) {
    if (!(restitution_ < 1)) return false;
    bool collapses = false;
    for (std::size_t i = 0; i < cluster.members.size(); ++i) {
      const Slot slot = cluster.members[i];
      Real speed = 0;
      Real reach = 0;
      for (const ClusterContact<Real>& contact : cluster.contacts) {
        if (contact.a != i && contact.b != i) continue;
        if (contact.withWall() && dot(flights_.acceleration(slot), contact.normal) > 0) continue;
        if (contact.approach_speed > speed) {
          speed = contact.approach_speed;
          reach = contact.reach;
        }
      }
      if (speed > 0 && flights_.histories[slot].record(flights_.now, speed, reach))
        collapses = true;
    }
    return collapses;
  }

  // Counts and reports a contact after its impact.
  void conclude(const TouchingCluster<Real>& cluster, const ClusterContact<Real>& contact) {
    if (!(contact.impulse > 0)) return;
    const Slot slot = cluster.members[contact.a];
    noteOverlap(-contact.gap);
    if (!contact.withWall()) {
      ++statistics_.ball_collisions;
      statistics_.virial += double(contact.impulse * contact.reach);
      report(slot, agenda(cluster.members[contact.b]).id, contact.normal, contact.impulse,
             contact.approach_speed);
      return;
    }
    const Wall<Real>& wall = walls_[contact.wall];
    if constexpr (kGravity) {
      const Body<Real>& flight = body(slot);
      const Real pull = dot(flights_.contacts.acceleration(slot), wall.normal);
      if (comesToRest<Real>(dot(flight.v, wall.normal), pull, flight.radius)) {
        flights_.contacts.rest(slot, static_cast<int>(contact.wall));
      }
    }
    ++statistics_.wall_collisions;
    report(slot, wall.partner, contact.normal, contact.impulse, contact.approach_speed);
  }

  // After any change of velocity: events found with the old one are stale; walls rested on are
  // left or kept.
  void velocityChanged(Slot slot) {
    ++agenda(slot).version;
    if constexpr (kGravity) {
      flights_.contacts.velocityChanged(slot, body(slot).v, body(slot).radius, walls_);
    }
  }

  // --- bookkeeping

  void noteOverlap(Real overlap) {
    statistics_.deepest_overlap = std::max(statistics_.deepest_overlap, double(overlap));
  }

  void report(Slot slot, Partner b, const Vec& n, Real impulse, Real speed) {
    if (log_ == nullptr) return;
    Collision collision;
    collision.time = origin_ + double(flights_.now);
    collision.a = agenda(slot).id;
    collision.b = b;
    collision.point = space_.wrapped(body(slot).x + body(slot).radius * n).template cast<double>();
    collision.normal = n.template cast<double>();
    collision.impulse = double(impulse);
    collision.approach_speed = double(speed);
    log_->add(collision);
  }

  static constexpr Real kEventsPerBucket = 4;
  static constexpr std::uint64_t kCrossingsPerSorting = 32;  // a ball

  Surroundings surroundings_;
  SimultaneousImpacts policy_;
  Real restitution_;
  std::vector<Wall<Real>> walls_;

  PeriodicSpace<Real> space_;
  Flights<Real, kGravity> flights_;
  std::vector<Slot> slots_;   // of the balls there are, by ascending id
  Slot free_slot_ = kNoSlot;  // the one used last; its agenda's `next` tells of another
  MemoryOrder memory_order_;
  Neighbourhood<Real> neighbourhood_;
  ImpactSearch<Real, kGravity> impacts_;
  EventQueue<Real, GoesFirst> queue_;
  bool ready_ = false;  // neighbourhood and queue hold all balls
  std::size_t balls_at_layout_ = 0;
  std::uint64_t crossings_ = 0;  // out of a cell or region
  std::uint64_t crossings_when_sorted_ = 0;

  Time origin_;   // when this year began
  Time reached_;  // what now() tells
  std::uint64_t events_at_new_year_ = 0;
  OrderWatch<Real> watch_{surroundings_.gravity};
  Statistics statistics_;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
