// Method event_driven: hard-sphere event-driven dynamics. Nothing happens between impacts, so only
// impacts are computed, in order of time, each exact to rounding.
//
// Every ball holds its own next event (an impact with a ball or wall, or the way out of its cell)
// and sits once in the queue. An impact found with a partner that has meanwhile changed is noticed
// when it comes up (the partner's version tells) and searched again. A ball's place is stored at
// its own last change and nowhere else: reading, crossing and searching leave no trace in the
// trajectory.
//
// Who is near is told by cells where balls fly far between impacts, and by neighbour lists where
// they rattle among the same neighbours (see wantsLists()).
//
// Gets right: everything hard and elastic or dissipative, any masses and radii, walls, gravity,
// at any speed: no impact is missed, none is seen twice. Misses: contact that lasts. A ball comes
// to rest on walls; a ball on another ball keeps bouncing, ever lower, down to a hum of 1e-6 of
// their radii. Impacts at one instant are taken one after the other, by the smaller ids first, or
// together (simultaneous_impacts.hpp).
// Limits: 2^27 balls; 2^30 cells from the origin of an open scene.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <vector>

#include "ball_sim/collapse_guard.hpp"
#include "ball_sim/collision_law.hpp"
#include "ball_sim/method.hpp"
#include "ball_sim/scene.hpp"
#include "ball_sim/simultaneous_impacts.hpp"
#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/walls.hpp"
#include "event_driven/cell_grid.hpp"
#include "event_driven/contacts.hpp"
#include "event_driven/event_queue.hpp"
#include "event_driven/grid_layout.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/neighbour_lists.hpp"
#include "event_driven/pair_search.hpp"
#include "impact.hpp"

namespace ball_sim::core {

/// @tparam Real      double or long double
/// @tparam kGravity  whether balls fall; without it no acceleration is stored or computed
template <class Real, bool kGravity>
class EventDriven final : public Method {
  using Vec = VectorOf<Real>;

 public:
  explicit EventDriven(const Surroundings& surroundings,
                       SimultaneousImpacts policy = SimultaneousImpacts::sequential)
      : surroundings_(surroundings),
        policy_(policy),
        restitution_(Real(surroundings.restitution)),
        walls_(wallsOf<Real>(surroundings)),
        contacts_(surroundings.gravity.cast<Real>()),
        queue_(agendas_, GoesFirst{this}) {
    for (std::size_t k = 0; k < walls_.size(); ++k) {
      const Partner partner = walls_[k].partner;
      if (partner > planePartner(0)) {
        face_walls_[static_cast<std::size_t>(-1 - partner)] = static_cast<std::uint32_t>(k);
      } else {
        planes_.push_back(static_cast<std::uint32_t>(k));
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (!surroundings.periodic || (axis == 2 && surroundings.planar())) continue;
      period_[axis] = Real(surroundings.box.max[axis]) - Real(surroundings.box.min[axis]);
      space_.period[axis] = period_[axis];
      space_.per_period[axis] = 1 / period_[axis];
    }
    space_.fall = surroundings.gravity.cast<Real>();
  }

  const char* name() const override { return "event_driven"; }

  void insert(BallId id, const Ball& ball) override {
    assert(slots_.empty() || agendas_[slots_.back()].id < id);
    const Slot slot = takeSlot();
    bodies_[slot] = {ball.position.cast<Real>(), ball.velocity.cast<Real>(), now_,
                     Real(ball.radius)};
    agendas_[slot].mass = ball.mass;
    agendas_[slot].id = id;
    slots_.push_back(slot);
    if (restitution_ < 1) histories_[slot] = {};
    if constexpr (kGravity) contacts_.release(slot, isFixed(slot));
    ++agendas_[slot].version;
    if (slots_.size() > 2 * balls_at_layout_ + 16 || !fits(slot)) ready_ = false;
    if (ready_) settleIn(slot);
  }

  void remove(BallId id) override {
    const auto found = find(id);
    const Slot slot = *found;
    if (ready_) {
      lift(slot);
      if (listed_) lists_.renew(slot, nullptr, 0);
    }
    ++agendas_[slot].version;
    slots_.erase(found);
    free_slots_.push_back(slot);
  }

  void setMotion(BallId id, const Vector3& position, const Vector3& velocity) override {
    const Slot slot = *find(id);
    if (ready_) lift(slot);
    Body<Real>& body = bodies_[slot];
    body.x = position.cast<Real>();
    body.v = velocity.cast<Real>();
    body.time = now_;
    ++agendas_[slot].version;
    if constexpr (kGravity) contacts_.release(slot, false);
    if (ready_) settleIn(slot);
  }

  void setVelocity(BallId id, const Vector3& velocity) override {
    const Slot slot = *find(id);
    settle(slot);
    bodies_[slot].v = velocity.cast<Real>();
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
          reached_ = origin_ + double(now_);
          return false;
        }
        const auto due = queue_.pop();
        now_ = std::max(now_, due.time);
        ++statistics_.events;
        handle(due.slot);
      }
      if (limit < queue_.yearLength()) {
        now_ = limit;
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
      states.ids[i] = agendas_[slot].id;
      states.positions[i] = wrapped(positionNow(slot)).template cast<double>();
      states.velocities[i] = velocityNow(slot).template cast<double>();
    }
  }

  Ball ball(BallId id) const override {
    const Slot slot = *find(id);
    return {wrapped(positionNow(slot)).template cast<double>(),
            velocityNow(slot).template cast<double>(), double(bodies_[slot].radius),
            agendas_[slot].mass};
  }

  std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                    std::optional<BallId> ignore) const override {
    std::optional<BallId> found;
    for (const Slot slot : slots_) {
      const BallId id = agendas_[slot].id;
      if (id == ignore || (found && *found < id)) continue;
      const Vec dx = nearestImage(positionNow(slot) - position.cast<Real>());
      const Real reach = (bodies_[slot].radius + Real(radius)) * (1 - Real(1e-12));
      if (dot(dx, dx) < reach * reach) found = id;
    }
    return found;
  }

  Statistics statistics() const override {
    Statistics statistics = statistics_;
    statistics.queue_depth = slots_.size();
    statistics.bytes = grid_.bytes() + queue_.bytes() + capacityBytes(bodies_) +
                       capacityBytes(agendas_) + capacityBytes(slots_) + capacityBytes(histories_) +
                       lists_.bytes() + contacts_.bytes();
    return statistics;
  }

  void setCollisionLog(CollisionLog* log) override { log_ = log; }

 private:
  static constexpr std::uint32_t kWall = 0xF8000000;

  // The ball that another has parted from at this instant.
  struct JustMet {
    Slot partner = kNoSlot;
    Vec normal = Vec::Zero();  // towards it
  };

  struct Found {
    Real time = kNever<Real>;  // s, in this year
    std::uint32_t partner = 0;
  };

  // Balls as PairSearch takes them.
  struct Near {
    const Slot* slots;
    std::size_t count;
  };

  template <class Vector>
  static std::size_t capacityBytes(const Vector& v) {
    return v.capacity() * sizeof(typename Vector::value_type);
  }

  // --- ids and slots

  std::vector<Slot>::iterator find(BallId id) {
    return std::lower_bound(slots_.begin(), slots_.end(), id,
                            [this](Slot slot, BallId other) { return agendas_[slot].id < other; });
  }
  std::vector<Slot>::const_iterator find(BallId id) const {
    return const_cast<EventDriven*>(this)->find(id);
  }

  Slot takeSlot() {
    if (!free_slots_.empty()) {
      const Slot slot = free_slots_.back();
      free_slots_.pop_back();
      return slot;
    }
    const std::size_t count = bodies_.size() + 1;
    bodies_.resize(count);
    agendas_.resize(count);
    if (restitution_ < 1) histories_.resize(count);
    if constexpr (kGravity) contacts_.resize(count);
    grid_.resize(count);
    if (listed_) lists_.resize(count);
    return static_cast<Slot>(count - 1);
  }

  bool isFixed(Slot slot) const { return std::isinf(agendas_[slot].mass); }
  Real inverseMass(Slot slot) const { return 1 / Real(agendas_[slot].mass); }  // 1/kg; 0: fixed

  // Of events at one instant the one with the smaller of its two ids goes first, then by the other
  // id, where a wall comes before all balls.
  struct GoesFirst {
    const EventDriven* method;
    bool operator()(Slot a, Slot b) const { return method->rank(a) < method->rank(b); }
  };

  std::tuple<BallId, Partner, Slot> rank(Slot slot) const {
    const Agenda<Real>& agenda = agendas_[slot];
    if (agenda.crossing_time < agenda.impact_time) return {agenda.id, agenda.id, slot};
    if (agenda.partner >= kWall) {
      return {agenda.id, walls_[agenda.partner - kWall].partner, slot};
    }
    const BallId other = agendas_[agenda.partner].id;
    return {std::min(agenda.id, other), std::max(agenda.id, other), slot};
  }

  // Fetches from memory what balls that come up soon will need: the second step needs what the
  // first has fetched.
  auto expectation() {
    return [this](Slot slot, std::uint32_t buckets_ahead) {
      const Agenda<Real>& agenda = agendas_[slot];
      const bool crosses = agenda.crossing_time < agenda.impact_time;
      const bool meets = !crosses && agenda.partner < kWall;
      if (buckets_ahead == EventQueue<Real, GoesFirst>::kSoon) {
        __builtin_prefetch(&bodies_[slot]);
        if (listed_) lists_.prefetch(slot);
        if (!meets) return;
        __builtin_prefetch(&bodies_[agenda.partner]);
        __builtin_prefetch(&agendas_[agenda.partner]);
        if (listed_) lists_.prefetch(agenda.partner);
      } else if (crosses) {
        prefetchNewcomers(slot);
      } else {
        prefetchBodies(nearTo(slot));
        // In cells the partner's are mostly the same, and dear to find.
        if (meets && listed_) prefetchBodies(nearTo(agenda.partner));
      }
    };
  }

  void prefetchNewcomers(Slot slot) {
    if (listed_) {
      const Near near = inCellsAround(slot);
      for (std::size_t i = 0; i < near.count; ++i) lists_.prefetchHome(near.slots[i]);
      return;
    }
    const Agenda<Real>& agenda = agendas_[slot];
    grid_.foreseeNewLayer(agenda.cell, agenda.level, agenda.crossing_axis,
                          agenda.crossing_direction, candidates_);
    prefetchBodies({candidates_.slots.data(), candidates_.count});
  }

  void prefetchBodies(const Near& near) const {
    for (std::size_t i = 0; i < near.count; ++i) __builtin_prefetch(&bodies_[near.slots[i]]);
  }

  // --- motion between events

  Vec positionAt(Slot slot, Real time) const {
    const Body<Real>& body = bodies_[slot];
    const Real dt = time - body.time;
    if constexpr (kGravity) return body.x + dt * (body.v + (dt / 2) * contacts_.acceleration(slot));
    return body.x + dt * body.v;
  }

  Vec velocityAt(Slot slot, Real time) const {
    const Body<Real>& body = bodies_[slot];
    if constexpr (kGravity) return body.v + (time - body.time) * contacts_.acceleration(slot);
    return body.v;
  }

  Vec positionNow(Slot slot) const { return positionAt(slot, now_); }
  Vec velocityNow(Slot slot) const { return velocityAt(slot, now_); }

  // Stores the place of now, for a change of velocity to start from.
  void settle(Slot slot) {
    Body<Real>& body = bodies_[slot];
    body.x = positionNow(slot);
    body.v = velocityNow(slot);
    body.time = now_;
  }

  Vec nearestImage(Vec dx) const {
    for (int axis = 0; axis < 3; ++axis) {
      dx[axis] -= nearestWhole(dx[axis] * space_.per_period[axis]) * period_[axis];
    }
    return dx;
  }

  // From a to the image of b that it meets: the nearest, but where the box is so small that several
  // are in reach, the one it approaches fastest.
  Vec contactVector(const Body<Real>& a, const Body<Real>& b, Real reach) const {
    Vec nearest = nearestImage(b.x - a.x);
    if (images_.empty()) return nearest;
    Vec best = nearest;
    Real fastest = -kNever<Real>;
    for (const Vec& shift : images_) {
      const Vec dx = nearest + shift;
      const Real approach = -dot(dx, Vec(b.v - a.v));
      if (dot(dx, dx) < reach * reach * Real(1 + 1e-9) && approach > fastest) {
        fastest = approach;
        best = dx;
      }
    }
    return best;
  }

  // A crossing puts a ball back into the periodic box a rounding error early or late.
  Vec wrapped(Vec x) const {
    for (int axis = 0; axis < 3; ++axis) {
      if (!(period_[axis] > 0)) continue;
      if (x[axis] < Real(surroundings_.box.min[axis])) x[axis] += period_[axis];
      if (x[axis] >= Real(surroundings_.box.max[axis])) x[axis] -= period_[axis];
    }
    return x;
  }

  // --- layout: cells or lists, and the calendar

  bool fits(Slot slot) const {
    const Real width = 2 * bodies_[slot].radius * Real(kCellMargin);
    return ready_ && width <= (listed_ ? list_reach_ : coarsest_edge_);
  }

  std::uint8_t levelOf(Real radius) const {
    std::size_t level = grid_.levels().size() - 1;
    using std::ldexp;
    while (level > 0 &&
           ldexp(coarsest_edge_, -grid_.levels()[level].depth()) < 2 * radius * Real(kCellMargin)) {
      --level;
    }
    return static_cast<std::uint8_t>(level);
  }

  // Builds cells, lists and calendar for the balls as they are now, and finds every ball's next
  // event.
  void layOut() {
    std::vector<GridBall<Real>> balls;
    balls.reserve(slots_.size());
    for (const Slot slot : slots_) {
      bringHome(slot);
      balls.push_back({positionNow(slot), bodies_[slot].radius});
    }
    cutSpace(balls);
    coarsest_edge_ = coarsestEdge(grid_);
    renumber(balls);
    grid_.resize(bodies_.size());
    if (listed_) lists_.reset(bodies_.size(), regions_);
    for (const Slot slot : slots_) place(slot);
    for (const Slot slot : slots_) {
      if (!listed_) break;
      const Near near = inCellsAround(slot);
      lists_.fill(slot, near.slots, near.count);
    }
    balls_at_layout_ = slots_.size();
    crossings_at_layout_ = crossings_;
    ready_ = true;
    for (const Slot slot : slots_) findNextEvent(slot);
    setCalendar(estimatedEventRate());
  }

  // Decides between cells and lists, and whether the nearest image of a ball in a periodic box is
  // the only one in reach.
  void cutSpace(const std::vector<GridBall<Real>>& balls) {
    listed_ = wantsLists(surroundings_, balls);
    if (listed_) {
      Real largest = 0;
      for (const GridBall<Real>& ball : balls) largest = std::max(largest, ball.radius);
      const Real half = Real(NeighbourLists::kHalfRegion) * largest;
      list_reach_ = 2 * largest * Real(kCellMargin);
      grid_ = layOutGrid<Real>(surroundings_, balls, 2 * half);
      homes_ = grid_.lattice(NeighbourLists::kLatticeDepth);
      regions_.reach = static_cast<float>(list_reach_);
      for (std::size_t k = 0; k < 3; ++k) {
        regions_.width[k] = static_cast<std::int32_t>(2 * half / homes_.spacing[k]);
        regions_.round[k] = grid_.pointsRound(k, NeighbourLists::kLatticeDepth);
        regions_.spacing[k] = static_cast<float>(homes_.spacing[k]);
        homes_.half[k] = Real(regions_.width[k]) * homes_.spacing[k] / 2;
      }
      listed_ = nearestImagesSuffice(grid_);
    }
    if (!listed_) {
      grid_ = layOutGrid<Real>(surroundings_, balls, 0);
      lists_ = {};
    }
    const bool nearest = nearestImagesSuffice(grid_);
    images_.clear();
    for (int image = 0; image < 27 && !nearest; ++image) {
      const Vec turns(Real(image % 3 - 1), Real(image / 3 % 3 - 1), Real(image / 9 - 1));
      const Vec shift = turns.cwiseProduct(period_);
      if (std::find(images_.begin(), images_.end(), shift) == images_.end()) {
        images_.push_back(shift);
      }
    }
    search_pairs_ = choosePairSearch<Real>(surroundings_.periodic && nearest, kGravity,
                                           listed_ ? kSearchStep : kLanesForFew);
  }

  // Gives the balls new slots along a space-filling curve, so that neighbours in space are
  // neighbours in memory.
  void renumber(const std::vector<GridBall<Real>>& balls) {
    struct Place {
      std::uint64_t key;
      std::uint32_t rank;  // in slots_
    };
    std::vector<Place> places;
    places.reserve(slots_.size());
    const int finest = grid_.levels().back().depth();
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      places.push_back(
          {mortonKey(grid_.coordinatesOf(balls[i].x, finest)), static_cast<std::uint32_t>(i)});
    }
    std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
      return a.key != b.key ? a.key < b.key : a.rank < b.rank;
    });
    const auto reorder = [&](auto& values) {
      if (values.empty()) return;
      std::remove_reference_t<decltype(values)> ordered;
      ordered.reserve(places.size());
      for (const Place& place : places) ordered.push_back(values[slots_[place.rank]]);
      values = std::move(ordered);
    };
    reorder(bodies_);
    reorder(agendas_);
    reorder(histories_);
    reorder(contacts_.numbers());
    free_slots_.clear();
    for (std::size_t i = 0; i < places.size(); ++i) slots_[places[i].rank] = static_cast<Slot>(i);
  }

  // Events per second, from the times at which half of the balls have their next one. What happens
  // at once, as on a lattice laid just along the cells, tells nothing of what comes after.
  Real estimatedEventRate() const {
    Real longest = 0;
    const auto wait = [this](Slot slot) { return agendas_[slot].due() - now_; };
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

  // A year of about three events a ball at least.
  void setCalendar(Real events_per_second) {
    std::uint32_t buckets = 8;
    while (Real(buckets) * kEventsPerBucket < 3 * Real(slots_.size())) buckets *= 2;
    const Real width = events_per_second > 0 ? kEventsPerBucket / events_per_second : Real(1);
    // Clocks restart with the calendar.
    shiftClocks(now_);
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

  void shiftClocks(Real by) {
    if (by == 0) return;
    origin_ = origin_ + double(by);
    now_ -= by;
    watch_.setBack(by);
    for (const Slot slot : slots_) {
      bodies_[slot].time -= by;
      agendas_[slot].impact_time -= by;
      agendas_[slot].crossing_time -= by;
      if (restitution_ < 1) histories_[slot].last -= by;
    }
  }

  // Moves all clocks back by whole years, to the next one in which anything happens.
  void turnYear(Real limit) {
    const Real year = queue_.yearLength();
    const Real next = std::min(limit, queue_.earliestBeyond());
    const Real years = std::max(Real(1), std::floor(next / year));
    now_ = years * year;
    shiftClocks(now_);
    // A place stored many years ago would lose digits of its time.
    for (const Slot slot : slots_) {
      if (bodies_[slot].time < -32 * year) settle(slot);
    }
    queue_.turnYear();
    // Balls that have mixed lie at random in memory again, which matters beyond the caches.
    if (slots_.size() > kCachedBalls &&
        crossings_ - crossings_at_layout_ > kCrossingsPerLayout * slots_.size()) {
      layOut();
    } else {
      retuneCalendar(years);
    }
  }

  void retuneCalendar(Real years) {
    const auto events = Real(statistics_.events - events_at_new_year_);
    events_at_new_year_ = statistics_.events;
    const Real per_bucket = events / (years * queue_.yearLength() / queue_.bucketWidth());
    const bool off = per_bucket > 2 * kEventsPerBucket || 2 * per_bucket < kEventsPerBucket;
    if (off && events > 0) setCalendar(per_bucket / queue_.bucketWidth());
  }

  // Takes a ball into the periodic box by whole periods.
  void bringHome(Slot slot) {
    using std::floor;
    const Vec x = positionNow(slot);
    for (int axis = 0; axis < 3; ++axis) {
      if (!(period_[axis] > 0)) continue;
      const Real turns = floor((x[axis] - Real(surroundings_.box.min[axis])) / period_[axis]);
      if (turns != 0) bodies_[slot].x[axis] -= turns * period_[axis];
    }
  }

  // Puts a ball into the cell in which it is now.
  void place(Slot slot) {
    Agenda<Real>& agenda = agendas_[slot];
    bringHome(slot);
    agenda.level = levelOf(bodies_[slot].radius);
    const int depth = grid_.levels()[agenda.level].depth();
    if (listed_) {
      const int fine = depth + NeighbourLists::kLatticeDepth;
      const CellCoordinates home = grid_.coordinatesOf(positionNow(slot), fine);
      lists_.setHome(slot, home);
      agenda.cell = CellGrid<Real>::coarser(home, fine, depth);
    } else {
      agenda.cell = grid_.coordinatesOf(positionNow(slot), depth);
    }
    grid_.link(slot, agenda.cell, agenda.level);
  }

  // Puts a ball that came while others fly among them.
  void settleIn(Slot slot) {
    place(slot);
    if (listed_) {
      const Near near = inCellsAround(slot);
      lists_.renew(slot, near.slots, near.count);
    }
    search(slot);
  }

  void lift(Slot slot) {
    queue_.remove(slot);
    grid_.unlink(slot, agendas_[slot].cell, agendas_[slot].level);
  }

  // --- events

  void handle(Slot slot) {
    const Agenda<Real>& agenda = agendas_[slot];
    if (agenda.crossing_time < agenda.impact_time) {
      ++crossings_;
      listed_ ? moveHouse(slot) : cross(slot);
    } else if (agenda.partner >= kWall) {
      meetWall(slot, agenda.partner - kWall);
    } else if (agendas_[agenda.partner].version == agenda.partner_version) {
      meetBall(slot, agenda.partner);
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
    Agenda<Real>& agenda = agendas_[slot];
    const CellCoordinates before = agenda.cell;
    const std::size_t axis = agenda.crossing_axis;
    const int direction = agenda.crossing_direction;
    enterCell(slot, axis, before[axis] + direction);
    grid_.move(slot, before, agenda.cell, axis, agenda.level);
    if (!images_.empty()) return search(slot);  // other images are in reach now, too
    Found found{agenda.impact_time, agenda.partner};
    grid_.gatherNewLayer(before, agenda.cell, agenda.level, axis, direction, candidates_);
    considerBalls(seekerAt(slot, {}), {candidates_.slots.data(), candidates_.count}, found);
    considerWallsOf(slot, found);
    if (found.time < agenda.impact_time) setImpact(slot, found);
    findCrossing(slot);
    queue_.insert(slot);
  }

  // A ball that left the periodic box comes in again on the other side.
  void enterCell(Slot slot, std::size_t axis, std::int32_t coordinate) {
    Agenda<Real>& agenda = agendas_[slot];
    const int k = static_cast<int>(axis);
    if (grid_.axis(axis).periodic) {
      const std::int32_t count = grid_.count(axis, agenda.level);
      if (coordinate < 0) {
        coordinate = count - 1;
        bodies_[slot].x[k] += period_[k];
      } else if (coordinate == count) {
        coordinate = 0;
        bodies_[slot].x[k] -= period_[k];
      }
    } else if (coordinate > kFarthestCell || coordinate < -kFarthestCell) {
      throw std::range_error("ball " + std::to_string(agenda.id) + " has flown 2^30 cells away");
    }
    agenda.cell[axis] = coordinate;
  }

  Impacting<Real> impacting(Slot slot) {
    return {bodies_[slot].v, inverseMass(slot), restitution_ < 1 ? histories_[slot] : no_history_};
  }

  void meetBall(Slot first, Slot second) {
    if (policy_ == SimultaneousImpacts::simultaneous && meetTogether(first, second)) return;
    if (agendas_[second].id < agendas_[first].id) std::swap(first, second);
    settle(first);
    settle(second);
    Body<Real>& a = bodies_[first];
    Body<Real>& b = bodies_[second];
    const Real reach = a.radius + b.radius;
    const Vec dx = contactVector(a, b, reach);
    Vec pressing = Vec::Zero();
    if constexpr (kGravity) {
      pressing = contacts_.acceleration(first) - contacts_.acceleration(second);
    }
    const auto impact = core::meetBall<Real>(dx, reach, pressing, restitution_, now_,
                                             impacting(first), impacting(second));
    const Vec& n = impact.normal;
    const Exchange<Real>& passed = impact.exchange;
    if (passed.impulse > 0) {
      ++statistics_.ball_collisions;
      statistics_.virial += double(passed.impulse * reach);
      noteOverlap(impact.overlap);
      watch({agendas_[first].id, a.v, inverseMass(first), passed.change1},
            {agendas_[second].id, b.v, inverseMass(second), passed.change2}, n,
            passed.approach_speed, reach);
      report(first, agendas_[second].id, n, passed.impulse, passed.approach_speed);
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
    settle(slot);
    Body<Real>& body = bodies_[slot];
    const Wall<Real>& wall = walls_[index];
    Real pull = 0;
    if constexpr (kGravity) pull = dot(contacts_.acceleration(slot), wall.normal);
    const auto impact =
        core::meetWall<Real>(wall, body.x, body.radius, pull, restitution_, now_, impacting(slot));
    noteOverlap(impact.overlap);
    if constexpr (kGravity) {
      if (impact.rests) contacts_.rest(slot, static_cast<int>(index));
    }
    if (impact.speed > 0) {
      ++statistics_.wall_collisions;
      const Vec at_rest = Vec::Zero();
      const Real change = (1 + impact.restitution) * impact.speed;
      watch({agendas_[slot].id, body.v, inverseMass(slot), change},
            {OrderWatch<Real>::wallKey(index), at_rest, 0, 0}, -wall.normal, impact.speed,
            body.radius);
      report(slot, wall.partner, -wall.normal, change * Real(agendas_[slot].mass), impact.speed);
    }
    velocityChanged(slot);
    search(slot);
  }

  void watch(const typename OrderWatch<Real>::Side& a, const typename OrderWatch<Real>::Side& b,
             const Vec& normal, Real speed, Real reach) {
    if (watch_.note(now_, a, b, normal, speed, reach, restitution_)) {
      ++statistics_.ambiguous_impacts;
    }
  }

  // --- policy `simultaneous`

  // Balls that touch each other, or through others, at this instant.
  struct Cluster {
    std::vector<Slot> members;  // by ascending id
    std::vector<ClusterBody<Real>> bodies;
    std::vector<ClusterContact<Real>> contacts;  // by bodies
  };

  // One round of joint reflections of the cluster around an impact of `slot`, which is not queued.
  // @param other  the ball it meets, or kNoSlot
  // @return false: nothing else approaches there, and the impact is one like others
  bool meetTogether(Slot slot, Slot other) {
    Cluster cluster = clusterAround(slot, other);
    keepApproaching(cluster.bodies, cluster.contacts);
    if (cluster.contacts.size() < 2) return false;
    if (orderMatters<Real>(cluster.bodies, cluster.contacts, space_.fall, restitution_)) {
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
      settle(member);
      bodies_[member].v = v;
      if (member != slot) queue_.remove(member);
    });
    for (const ClusterContact<Real>& contact : cluster.contacts) conclude(cluster, contact);
    forChanged([&](Slot member, const Vec&) { velocityChanged(member); });
    forChanged([&](Slot member, const Vec&) { search(member); });
    if (!changed[indexIn(cluster, slot)]) search(slot);
    return true;
  }

  static std::size_t indexIn(const Cluster& cluster, Slot slot) {
    const auto& members = cluster.members;
    return static_cast<std::size_t>(std::find(members.begin(), members.end(), slot) -
                                    members.begin());
  }

  Cluster clusterAround(Slot slot, Slot other) {
    Cluster cluster;
    std::vector<Slot>& members = cluster.members;
    members.push_back(slot);
    if (other != kNoSlot) members.push_back(other);
    for (std::size_t k = 0; k < members.size(); ++k) {
      if (isFixed(members[k])) continue;  // hands nothing on
      forEachTouching(members[k], [&](Slot touched, const Vec&, Real) {
        if (indexIn(cluster, touched) == members.size()) members.push_back(touched);
      });
    }
    std::sort(members.begin(), members.end(),
              [&](Slot a, Slot b) { return agendas_[a].id < agendas_[b].id; });
    for (const Slot member : members) {
      cluster.bodies.push_back({velocityNow(member), inverseMass(member)});
    }
    for (std::size_t i = 0; i < members.size(); ++i) addContacts(cluster, i);
    return cluster;
  }

  // Calls f with each ball that `slot` touches now, the way to it, and the gap.
  template <class Function>
  void forEachTouching(Slot slot, Function f) {
    using std::sqrt;
    const Near near = nearTo(slot);
    for (std::size_t i = 0; i < near.count; ++i) {
      const Slot other = near.slots[i];
      if (other == slot) continue;
      const Vec nearest = nearestImage(positionNow(other) - positionNow(slot));
      const Real reach = bodies_[slot].radius + bodies_[other].radius;
      const Real extent = std::max(extentOf(slot), extentOf(other));
      forEachImage([&](const Vec& image) {
        const Vec dx = nearest + image;
        const Real gap = sqrt(dot(dx, dx)) - reach;
        if (touches(gap, reach, extent)) f(other, dx, gap);
      });
    }
  }

  // What a ball's place was last computed from: where it is, and how far it may have come.
  Real extentOf(Slot slot) const {
    const Vec v = velocityNow(slot);
    return positionNow(slot).cwiseAbs().maxCoeff() + std::sqrt(dot(v, v)) * now_;
  }

  Vec accelerationOf(Slot slot) const {
    if constexpr (kGravity) return contacts_.acceleration(slot);
    return Vec::Zero();
  }

  // Those of member i with walls, and with members after it.
  void addContacts(Cluster& cluster, std::size_t i) {
    const Slot slot = cluster.members[i];
    const Real radius = bodies_[slot].radius;
    for (std::size_t k = 0; k < walls_.size() && !isFixed(slot); ++k) {
      const Real gap = dot(positionNow(slot), walls_[k].normal) - walls_[k].offset - radius;
      if (!touches(gap, radius, extentOf(slot))) continue;
      ClusterContact<Real> contact;
      contact.a = i;
      contact.wall = k;
      contact.normal = -walls_[k].normal;
      contact.gap = gap;
      contact.reach = radius;
      cluster.contacts.push_back(contact);
    }
    forEachTouching(slot, [&](Slot other, const Vec& dx, Real gap) {
      const std::size_t j = indexIn(cluster, other);
      if (j <= i || j == cluster.members.size() || (isFixed(slot) && isFixed(other))) return;
      ClusterContact<Real> contact;
      contact.a = i;
      contact.b = j;
      contact.normal = contactNormal<Real>(dx);
      contact.gap = gap;
      contact.reach = radius + bodies_[other].radius;
      const Vec pressing = accelerationOf(slot) - accelerationOf(other);
      contact.least_rebound = leastRebound<Real>(dot(pressing, contact.normal), contact.reach);
      cluster.contacts.push_back(contact);
    });
  }

  // Tells the guard against collapse, once a ball, by its fastest contact. @return whether any ball
  // is in a collapse
  bool recordImpacts(const Cluster& cluster) {
    if (!(restitution_ < 1)) return false;
    bool collapses = false;
    for (std::size_t i = 0; i < cluster.members.size(); ++i) {
      const Slot slot = cluster.members[i];
      Real speed = 0;
      Real reach = 0;
      for (const ClusterContact<Real>& contact : cluster.contacts) {
        if (contact.a != i && contact.b != i) continue;
        if (contact.withWall() && dot(accelerationOf(slot), contact.normal) > 0) continue;
        if (contact.approach_speed > speed) {
          speed = contact.approach_speed;
          reach = contact.reach;
        }
      }
      if (speed > 0 && histories_[slot].record(now_, speed, reach)) collapses = true;
    }
    return collapses;
  }

  // Counts and reports a contact after its impact.
  void conclude(const Cluster& cluster, const ClusterContact<Real>& contact) {
    if (!(contact.impulse > 0)) return;
    const Slot slot = cluster.members[contact.a];
    noteOverlap(-contact.gap);
    if (!contact.withWall()) {
      ++statistics_.ball_collisions;
      statistics_.virial += double(contact.impulse * contact.reach);
      report(slot, agendas_[cluster.members[contact.b]].id, contact.normal, contact.impulse,
             contact.approach_speed);
      return;
    }
    const Wall<Real>& wall = walls_[contact.wall];
    if constexpr (kGravity) {
      const Body<Real>& body = bodies_[slot];
      const Real pull = dot(contacts_.acceleration(slot), wall.normal);
      if (comesToRest<Real>(dot(body.v, wall.normal), pull, body.radius)) {
        contacts_.rest(slot, static_cast<int>(contact.wall));
      }
    }
    ++statistics_.wall_collisions;
    report(slot, wall.partner, contact.normal, contact.impulse, contact.approach_speed);
  }

  // After any change of velocity: events found with the old one are stale; walls rested on are
  // left or kept.
  void velocityChanged(Slot slot) {
    ++agendas_[slot].version;
    if constexpr (kGravity) {
      contacts_.velocityChanged(slot, bodies_[slot].v, bodies_[slot].radius, walls_);
    }
  }

  // --- search for a ball's next event

  // Finds the next event of a ball that is not queued, and queues it.
  void search(Slot slot, const JustMet& met = {}) {
    findNextEvent(slot, met);
    queue_.insert(slot);
  }

  void findNextEvent(Slot slot, const JustMet& met = {}) {
    Found found;
    considerBalls(seekerAt(slot, met), nearTo(slot), found);
    considerWallsOf(slot, found);
    setImpact(slot, found);
    findCrossing(slot);
  }

  // All that a ball can meet before its crossing, perhaps itself among them.
  Near nearTo(Slot slot) {
    if (listed_) return {lists_.of(slot), lists_.count(slot)};
    return inCellsAround(slot);
  }

  Near inCellsAround(Slot slot) {
    grid_.gatherNear(agendas_[slot].cell, agendas_[slot].level, candidates_);
    return {candidates_.slots.data(), candidates_.count};
  }

  // Calls f with the shifts of the images that are in reach of a ball beside the nearest.
  template <class Function>
  void forEachImage(Function f) const {
    if (images_.empty()) return f(Vec(Vec::Zero()));
    for (const Vec& image : images_) f(image);
  }

  void setImpact(Slot slot, const Found& found) {
    Agenda<Real>& agenda = agendas_[slot];
    agenda.impact_time = found.time;
    agenda.partner = found.partner;
    if (found.partner < kWall) agenda.partner_version = agendas_[found.partner].version;
  }

  // One ball in search of its next impact, and whom it has just parted from.
  struct Search {
    Slot slot;
    const JustMet& met;
    Seeker<Real> seeker;
  };

  Search seekerAt(Slot slot, const JustMet& met) const {
    return {slot, met, {positionNow(slot), velocityNow(slot), bodies_[slot].radius, now_}};
  }

  // Takes the earliest impact with any of the balls, if it is earlier than `found`. The ball
  // itself may be among them: it never approaches itself.
  void considerBalls(const Search& search, const Near& near, Found& found) {
    if (images_.empty()) return considerImages(search, near, found);
    for (const Vec& image : images_) {
      Search shifted = search;
      shifted.seeker.x -= image;
      considerImages(shifted, near, found);
    }
  }

  void considerImages(const Search& search, const Near& near, Found& found) {
    if (kGravity && !allFallFreely(search.slot, near)) return considerEach(search, near, found);
    const PairHit<Real> hit =
        search_pairs_(bodies_.data(), near.slots, near.count, search.seeker, space_);
    const Real time = now_ + hit.wait;
    const Slot other = near.slots[hit.index];
    const bool earlier = time < found.time;
    const bool as_early = (time == found.time) & (hit.wait < kNever<Real>);
    const bool met = (other == search.met.partner) & earlier;
    if (as_early | hit.tied | met) {  // seldom, and then not so simple
      considerEach(search, near, found);
      return;
    }
    // Not by branches, which would often be foretold wrongly.
    found.time = std::min(found.time, time);
    found.partner = earlier ? other : found.partner;
  }

  bool allFallFreely(Slot slot, const Near& near) const {
    const auto falls = [this](Slot s) { return contacts_.fallsFreely(s); };
    return falls(slot) && std::all_of(near.slots, near.slots + near.count, falls);
  }

  // The same, one by one: also where balls fall differently, or were just met, or tie.
  void considerEach(const Search& search, const Near& near, Found& found) {
    const Seeker<Real>& seeker = search.seeker;
    for (std::size_t i = 0; i < near.count; ++i) {
      const Slot other = near.slots[i];
      Vec dx = positionNow(other) - seeker.x;
      if (images_.empty()) dx = nearestImage(dx);
      const Vec dv = velocityNow(other) - seeker.v;
      Vec da = Vec::Zero();
      if constexpr (kGravity) {
        da = contacts_.acceleration(other) - contacts_.acceleration(search.slot);
      }
      const Real reach = bodies_[other].radius + seeker.radius;
      if (dot(da, da) > 0) {
        takeIfEarlier(other, now_ + timeOfImpactAccelerated<Real>(dx, dv, da, reach), found);
      } else if (!justParted(search, other)) {
        takeIfEarlier(other, now_ + timeOfImpact<Real>(dx, dv, reach), found);
      }
    }
  }

  // In straight relative motion two balls that have just met do not meet again. In a small periodic
  // box another image of the partner may be in reach too, but not in the same direction.
  bool justParted(const Search& search, Slot other) const {
    if (other != search.met.partner) return false;
    if (images_.empty()) return true;
    const Vec dx = positionNow(other) - search.seeker.x;
    const Real reach = bodies_[other].radius + search.seeker.radius;
    return dot(dx, search.met.normal) > Real(0.9) * reach;
  }

  void takeIfEarlier(Slot other, Real time, Found& found) const {
    if (time < found.time || (time == found.time && isEarlierTie(other, found))) {
      found = {time, other};
    }
  }

  bool isEarlierTie(Slot other, const Found& found) const {
    return found.time < kNever<Real> && found.partner < kWall &&
           agendas_[other].id < agendas_[found.partner].id;
  }

  // Box faces are only met from the cells beside them; planes from anywhere.
  void considerWallsOf(Slot slot, Found& found) const {
    if (!walls_.empty() && !isFixed(slot)) considerWalls(slot, found);
  }

  void considerWalls(Slot slot, Found& found) const {
    if (listed_) {
      for (std::uint32_t wall = 0; wall < walls_.size(); ++wall) considerWall(slot, wall, found);
      return;
    }
    const Agenda<Real>& agenda = agendas_[slot];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const int direction : {-1, 1}) {
        if (!grid_.isWall(axis, agenda.level, agenda.cell[axis], direction)) continue;
        considerWall(slot, face_walls_[2 * axis + (direction > 0 ? 1 : 0)], found);
      }
    }
    for (const std::uint32_t plane : planes_) considerWall(slot, plane, found);
  }

  void considerWall(Slot slot, std::uint32_t index, Found& found) const {
    const Wall<Real>& wall = walls_[index];
    Real pull = 0;
    if constexpr (kGravity) {
      if (contacts_.isRestingOn(slot, static_cast<int>(index))) return;
      pull = dot(contacts_.acceleration(slot), wall.normal);
    }
    const Real gap = dot(positionNow(slot), wall.normal) - wall.offset - bodies_[slot].radius;
    const Real time = now_ + timeToWall<Real>(gap, dot(velocityNow(slot), wall.normal), pull);
    if (time < found.time) found = {time, kWall + index};
  }

  // --- the way out of a ball's cell, or of the region around its home

  const Lattice<Real>& cubesOf(Slot slot) const {
    return listed_ ? homes_ : grid_.latticeOf(agendas_[slot].level);
  }
  const CellCoordinates& cubeOf(Slot slot) const {
    return listed_ ? lists_.home(slot) : agendas_[slot].cell;
  }

  void findCrossing(Slot slot) {
    agendas_[slot].crossing_time = kNever<Real>;
    if (isFixed(slot)) return;
    if constexpr (kGravity) {
      findCrossingFalling(slot);
    } else {
      findCrossingFlying(slot);
    }
  }

  // Without branches: which way out comes first cannot be foretold.
  void findCrossingFlying(Slot slot) {
    Agenda<Real>& agenda = agendas_[slot];
    const Vec x = positionNow(slot);
    const Vec& v = bodies_[slot].v;
    const Lattice<Real>& cubes = cubesOf(slot);
    const CellCoordinates& cube = cubeOf(slot);
    std::array<Real, 3> wait;
    for (std::size_t k = 0; k < 3; ++k) {
      const int i = static_cast<int>(k);
      const Real from_middle = x[i] - (cubes.first[k] + Real(cube[k]) * cubes.spacing[k]);
      const Real towards = cubes.half[k] - from_middle * std::copysign(Real(1), v[i]);
      wait[k] = std::max(towards, std::numeric_limits<Real>::min()) / std::abs(v[i]);
    }
    if (cubes.has_ends) {
      for (std::size_t k = 0; k < 3; ++k) {  // where there is no way out
        if (cube[k] == cubes.end[k][v[static_cast<int>(k)] < 0 ? 0 : 1]) wait[k] = kNever<Real>;
      }
    }
    const Real sooner = std::min(wait[0], wait[1]);
    const unsigned second = wait[1] < wait[0] ? 1 : 0;
    const unsigned third = wait[2] < sooner ? 1 : 0;
    const unsigned k = 2 * third + (second & ~third);
    agenda.crossing_time = now_ + std::min(sooner, wait[2]);
    agenda.crossing_axis = static_cast<std::uint8_t>(k);
    agenda.crossing_direction = v[static_cast<int>(k)] < 0 ? -1 : 1;
  }

  void findCrossingFalling(Slot slot) {
    const Vec x = positionNow(slot);
    const Vec v = velocityNow(slot);
    const Lattice<Real>& cubes = cubesOf(slot);
    const CellCoordinates& cube = cubeOf(slot);
    for (std::size_t k = 0; k < 3; ++k) {
      const int i = static_cast<int>(k);
      const Real half = cubes.half[k];
      const Real from_middle = x[i] - (cubes.first[k] + Real(cube[k]) * cubes.spacing[k]);
      const Real a = contacts_.acceleration(slot)[i];
      if (cube[k] != cubes.end[k][0]) {
        considerSide(slot, k, -1, timeToWall<Real>(half + from_middle, v[i], a));
      }
      if (cube[k] != cubes.end[k][1]) {
        considerSide(slot, k, 1, timeToWall<Real>(half - from_middle, -v[i], -a));
      }
    }
  }

  void considerSide(Slot slot, std::size_t axis, int direction, Real wait) {
    Agenda<Real>& agenda = agendas_[slot];
    if (!(now_ + wait < agenda.crossing_time)) return;
    agenda.crossing_time = now_ + wait;
    agenda.crossing_axis = static_cast<std::uint8_t>(axis);
    agenda.crossing_direction = static_cast<std::int8_t>(direction);
  }

  // --- bookkeeping

  void noteOverlap(Real overlap) {
    statistics_.deepest_overlap = std::max(statistics_.deepest_overlap, double(overlap));
  }

  void report(Slot slot, Partner b, const Vec& n, Real impulse, Real speed) {
    if (log_ == nullptr) return;
    Collision collision;
    collision.time = origin_ + double(now_);
    collision.a = agendas_[slot].id;
    collision.b = b;
    collision.point = wrapped(bodies_[slot].x + bodies_[slot].radius * n).template cast<double>();
    collision.normal = n.template cast<double>();
    collision.impulse = double(impulse);
    collision.approach_speed = double(speed);
    log_->add(collision);
  }

  static constexpr Real kEventsPerBucket = 4;
  static constexpr std::uint64_t kCrossingsPerLayout = 16;  // a ball
  static constexpr std::int32_t kFarthestCell = 1 << 30;

  Surroundings surroundings_;
  SimultaneousImpacts policy_;
  Real restitution_;
  std::vector<Wall<Real>> walls_;
  std::array<std::uint32_t, 6> face_walls_{};  // indices into walls_, by face
  std::vector<std::uint32_t> planes_;          // indices into walls_
  Vec period_ = Vec::Zero();                   // m; 0: that axis does not wrap

  // One entry a slot; a slot is reused when its ball is removed.
  HugePageVector<Body<Real>> bodies_;
  HugePageVector<Agenda<Real>> agendas_;
  std::vector<ImpactHistory<Real>> histories_;  // only where restitution is below 1
  ImpactHistory<Real> no_history_;              // stands in for them elsewhere
  Contacts<Real> contacts_;                     // only with gravity
  std::vector<Slot> slots_;                     // of the balls there are, by ascending id
  std::vector<Slot> free_slots_;

  CellGrid<Real> grid_;
  NeighbourLists lists_;
  bool listed_ = false;     // who is near is told by lists_, else by grid_ alone
  Lattice<Real> homes_;     // of the lists, with the regions around them
  Regions regions_;         // the same, as the lists see them
  Real list_reach_ = 0;     // m, largest sum of radii that the lists allow for
  Real coarsest_edge_ = 0;  // m, the shortest edge of a cell of the coarsest level
  std::size_t balls_at_layout_ = 0;
  std::uint64_t crossings_ = 0;  // out of a cell or region
  std::uint64_t crossings_at_layout_ = 0;
  bool ready_ = false;  // grid, lists and queue hold all balls
  EventQueue<Real, GoesFirst> queue_;

  PairSpace<Real> space_;
  PairSearch<Real> search_pairs_ = nullptr;
  std::vector<Vec> images_;  // m, shifts of a ball to be looked at: none but in small boxes
  Candidates candidates_;    // scratch of a search

  Time origin_;   // when this year began
  Real now_ = 0;  // s, in this year
  Time reached_;  // what now() tells
  std::uint64_t events_at_new_year_ = 0;
  OrderWatch<Real> watch_{surroundings_.gravity};
  Statistics statistics_;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
