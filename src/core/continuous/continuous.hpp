// Method continuous: frame by frame, and inside a frame every impact at its own time, earliest
// first, until none is left.
//
// At the start of a frame all balls are put into a grid by place, and all pairs whose paths over
// the frame come near enough are found in one pass through memory (swept_grid.hpp), which the
// threads share. The impacts inside the frame are taken slice of time by slice; after each its
// partners are searched anew for the rest of the frame. No queue outlives the frame, and nothing
// happens when a ball passes from cell to cell.
//
// The impacts of a short slice hardly have to do with each other. Those whose balls have no other
// one are planned: what each leads to is computed without changing anything, in the order of the
// grid, and shared by the threads. A plan holds unless a path that it leads to meets another within
// the slice, be it one of now or one that is planned too. What does not hold, and what shares
// balls, is taken in order of time; what happens there may end more plans, which have changed
// nothing so far. At the end of the slice the plans that are left come true.
//
// The result is that of event-driven dynamics, to the last bit independent of frames, grid, threads
// and of when advanceTo() was called: a ball's place is stored at its own last change and nowhere
// else, and the time of an impact is computed from what the two balls have stored, at the later of
// their two times. Frames only decide when it is computed.
//
// Gets right: everything hard and elastic or dissipative, any masses and radii, walls, gravity, at
// any speed: no impact is missed, none is seen twice. Misses: contact that lasts. A ball comes to
// rest on walls; a ball on another ball keeps bouncing, ever lower, down to a hum of 1e-6 of their
// radii. Simultaneous impacts are taken one after the other, by the smaller ids first; the policy
// `simultaneous` is refused.
// Limits: 2^27 balls.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "ball_sim/collapse_guard.hpp"
#include "ball_sim/method.hpp"
#include "ball_sim/simultaneous_impacts.hpp"
#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/walls.hpp"
#include "continuous/frame_length.hpp"
#include "continuous/swept_grid.hpp"
#include "continuous/worker_pool.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "impact.hpp"
#include "permutation.hpp"

namespace ball_sim::core {

/// @tparam Real      double or long double
/// @tparam kGravity  whether balls fall; without it no acceleration is stored or computed
template <class Real, bool kGravity>
class Continuous final : public Method {
  using Vec = VectorOf<Real>;
  using Slot = std::uint32_t;

 public:
  /// @param threads  >= 1
  Continuous(const Surroundings& surroundings, unsigned threads)
      : surroundings_(surroundings),
        gravity_(surroundings.gravity.cast<Real>()),
        restitution_(Real(surroundings.restitution)),
        walls_(wallsOf<Real>(surroundings)),
        grid_(axesOf(surroundings)),
        pool_(threads),
        alone_(1),
        workers_(threads) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!surroundings.periodic || (axis == 2 && surroundings.planar())) continue;
      period_[axis] = Real(surroundings.box.max[axis]) - Real(surroundings.box.min[axis]);
    }
  }

  const char* name() const override { return "continuous"; }

  void insert(BallId id, const Ball& ball) override {
    assert(slots_.empty() || cards_[slots_.back()].id < id);
    const auto slot = static_cast<Slot>(bodies_.size());
    bodies_.push_back(
        {ball.position.cast<Real>(), ball.velocity.cast<Real>(), now_, Real(ball.radius)});
    Card card;
    card.mass = ball.mass;
    card.id = id;
    cards_.push_back(card);
    if constexpr (kGravity) {
      accelerations_.push_back(isFixed(slot) ? Vec(Vec::Zero()) : gravity_);
      resting_.emplace_back();
    }
    if (!walls_.empty()) wall_visits_.push_back({});
    slots_.push_back(slot);
    bringHome(slot);
    changedFromOutside();
  }

  void remove(BallId id) override {
    const auto found = find(id);
    const Slot slot = *found;
    slots_.erase(found);
    // The last ball takes the place that is free now.
    const auto last = static_cast<Slot>(bodies_.size() - 1);
    if (slot != last) *find(cards_[last].id) = slot;
    forEachArray([&](auto& values) {
      values[slot] = values[last];
      values.pop_back();
    });
    frame_open_ = false;
  }

  void setMotion(BallId id, const Vector3& position, const Vector3& velocity) override {
    const Slot slot = *find(id);
    Body& body = bodies_[slot];
    body.x = position.cast<Real>();
    body.v = velocity.cast<Real>();
    body.time = now_;
    bringHome(slot);
    if constexpr (kGravity) {
      resting_[slot] = {};
      accelerations_[slot] = gravity_;
    }
    velocityChanged(slot);
    changedFromOutside();
  }

  void setVelocity(BallId id, const Vector3& velocity) override {
    const Slot slot = *find(id);
    settle(slot);
    bodies_[slot].v = velocity.cast<Real>();
    velocityChanged(slot);
    changedFromOutside();
  }

  bool advanceTo(Time target, std::uint64_t max_events) override {
    if (era_is_stale_) beginEra();
    while (true) {
      const Real limit = Real(target - origin_);
      if (!frame_open_) openFrame(limit);
      if (!takeImpacts(std::min(limit, frame_end_), max_events)) {
        reached_ = origin_ + double(now_);
        return false;
      }
      if (frame_open_ && limit <= frame_end_) {
        now_ = limit;
        reached_ = target;
        return true;
      }
      if (frame_open_) now_ = frame_end_;  // else it was cut short, at the time of an impact
      frame_open_ = false;
      if (now_ >= era_) turnEra();
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
      states.ids[i] = cards_[slot].id;
      states.positions[i] = wrapped(positionAt(slot, now_)).template cast<double>();
      states.velocities[i] = velocityAt(slot, now_).template cast<double>();
    }
  }

  Ball ball(BallId id) const override {
    const Slot slot = *find(id);
    return {wrapped(positionAt(slot, now_)).template cast<double>(),
            velocityAt(slot, now_).template cast<double>(), double(bodies_[slot].radius),
            cards_[slot].mass};
  }

  std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                    std::optional<BallId> ignore) const override {
    std::optional<BallId> found;
    for (Slot slot = 0; slot < bodies_.size(); ++slot) {
      const BallId id = cards_[slot].id;
      if (id == ignore || (found && *found < id)) continue;
      const Vec dx = nearestImage(positionAt(slot, now_) - position.cast<Real>());
      const Real reach = (bodies_[slot].radius + Real(radius)) * (1 - Real(1e-12));
      if (dot(dx, dx) < reach * reach) found = id;
    }
    return found;
  }

  Statistics statistics() const override {
    Statistics statistics = statistics_;
    statistics.queue_depth = pending_.size();
    statistics.bytes = grid_.bytes() + capacityBytes(bodies_) + capacityBytes(cards_) +
                       capacityBytes(accelerations_) + capacityBytes(resting_) +
                       capacityBytes(wall_visits_) + capacityBytes(slots_) +
                       capacityBytes(positions_) + capacityBytes(pending_) + capacityBytes(slice_) +
                       capacityBytes(waiting_) + capacityBytes(lone_) + capacityBytes(plans_) +
                       capacityBytes(plan_of_) + capacityBytes(in_turn_) + capacityBytes(happened_);
    for (const Worker& worker : workers_) {
      statistics.bytes += capacityBytes(worker.pairs) + capacityBytes(worker.found) +
                          capacityBytes(worker.disturbed) + worker.moved.capacity() / 8;
    }
    return statistics;
  }

  void setCollisionLog(CollisionLog* log) override { log_ = log; }

 private:
  // What others look at, in one cache line: the place at the ball's own time.
  struct alignas(64) Body {
    Vec x;      // m, at `time`; within the periodic box
    Vec v;      // m/s, at `time`
    Real time;  // s, in this era
    Real radius;
  };

  // What only an impact needs.
  struct alignas(64) Card {
    double mass = 0;               // kg
    Vec met_normal = Vec::Zero();  // of the last impact with a ball, from the smaller id
    ImpactHistory<Real> history;   // on the clock of this era
    BallId id = 0;
    BallId met = kNobody;       // the partner of that impact, when no change came after it
    std::uint32_t version = 0;  // another one after each change of this ball's path
  };

  // When a ball, left to itself, meets a wall.
  struct WallVisit {
    Real time = kNever<Real>;  // s, in this era
    std::uint32_t wall = 0;    // index into walls_
  };

  // An impact that will happen if neither partner changes before.
  struct Impact {
    Real time;           // s, in this era
    std::uint32_t a, b;  // slots; b may be kWall + index into walls_
    std::uint32_t version_a, version_b;
    std::array<std::int16_t, 3> image;  // b is met so many periods from where its body says
  };

  // A ball after an impact.
  struct Side {
    Body body;
    ImpactHistory<Real> history;
    WallVisit wall;  // its next
  };

  // What an impact of two balls leads to.
  struct Plan {
    enum class State { open, leads_too_far, dropped, came_true };

    Impact impact;              // a has the smaller id
    std::array<Side, 2> sides;  // of a and b
    BallImpact<Real> passed;
    std::uint32_t version = 0;  // of both balls' paths, once it comes true
    State state = State::open;
  };

  // The way that a ball goes on now, or would by a plan.
  struct Path {
    Slot slot;
    const Body* body;
    const Plan* plan = nullptr;  // nullptr: now
  };

  // An impact for the log.
  struct Reported {
    Impact impact;
    Collision collision;
  };

  // Two balls that may meet.
  struct Pair {
    Slot slot;
    std::uint32_t other;       // its position in the grid, from meetPairs() on its slot
    std::array<int, 3> turns;  // of the image that was found; 0 where only one is near
  };

  // What one thread needs.
  struct alignas(64) Worker {
    SweptSearch search;
    std::vector<Pair> pairs;               // found, and not looked at yet
    std::vector<Impact> found;             // after the slice
    std::vector<std::uint32_t> disturbed;  // plans that do not hold
    std::vector<bool> moved;               // by slot
  };

  static constexpr BallId kNobody = ~BallId{0};
  static constexpr std::uint32_t kWall = 0xF8000000;
  static constexpr std::uint32_t kFramesPerLayout = 64;
  static constexpr std::uint32_t kFramesPerRenumbering = 4;
  static constexpr std::size_t kFewBalls = 2000;  // not worth waking threads for
  static constexpr int kErasToSettle = 16;
  static constexpr std::size_t kBatch = 64;  // searches whose memory is asked for at once
  // Longer slices: more impacts share balls. Shorter: less is near in memory. A flat optimum.
  static constexpr double kImpactsPerBallAndSlice = 0.015;
  static constexpr std::size_t kFewImpacts = 8;  // not worth planning
  static constexpr std::size_t kFewPlans = 200;  // not worth waking threads for
  static constexpr std::uint32_t kNoPlan = 0xFFFFFFFF;
  static constexpr std::uint32_t kOnePlan = 0xFFFFFFFE;
  static constexpr std::uint32_t kManyPlans = 0xFFFFFFFD;

  template <class Vector>
  static std::size_t capacityBytes(const Vector& v) {
    return v.capacity() * sizeof(typename Vector::value_type);
  }

  static std::array<SweptAxis, 3> axesOf(const Surroundings& surroundings) {
    std::array<SweptAxis, 3> axes;
    for (int k = 0; k < 3; ++k) {
      SweptAxis& axis = axes[static_cast<std::size_t>(k)];
      const double low = surroundings.box.min[k], high = surroundings.box.max[k];
      axis.kind = SweptAxis::Kind::flat;
      if (k == 2 && surroundings.planar()) continue;
      axis.kind = SweptAxis::Kind::open;
      if (!std::isfinite(low) || !std::isfinite(high)) continue;
      axis.kind = surroundings.periodic ? SweptAxis::Kind::periodic : SweptAxis::Kind::closed;
      axis.origin = low;
      axis.length = high - low;
    }
    return axes;
  }

  // --- ids and slots

  std::vector<Slot>::iterator find(BallId id) {
    return std::lower_bound(slots_.begin(), slots_.end(), id,
                            [this](Slot slot, BallId other) { return cards_[slot].id < other; });
  }
  std::vector<Slot>::const_iterator find(BallId id) const {
    return const_cast<Continuous*>(this)->find(id);
  }

  // Calls f with each array that has one entry a slot.
  template <class Function>
  void forEachArray(Function f) {
    f(bodies_);
    f(cards_);
    if constexpr (kGravity) {
      f(accelerations_);
      f(resting_);
    }
    if (!walls_.empty()) f(wall_visits_);
  }

  bool isFixed(Slot slot) const { return std::isinf(cards_[slot].mass); }
  Real inverseMass(Slot slot) const { return 1 / Real(cards_[slot].mass); }  // 1/kg; 0: fixed

  // --- motion between impacts

  Vec acceleration(Slot slot) const {
    if constexpr (kGravity) return accelerations_[slot];
    return Vec::Zero();
  }

  Vec positionAt(Slot slot, Real time) const { return placeAt(pathOf(slot), time); }
  Vec velocityAt(Slot slot, Real time) const { return speedAt(pathOf(slot), time); }

  Path pathOf(Slot slot) const { return {slot, &bodies_[slot]}; }

  Vec placeAt(const Path& path, Real time) const {
    const Body& body = *path.body;
    const Real dt = time - body.time;
    if constexpr (kGravity) return body.x + dt * (body.v + (dt / 2) * accelerations_[path.slot]);
    return body.x + dt * body.v;
  }

  Vec speedAt(const Path& path, Real time) const {
    const Body& body = *path.body;
    if constexpr (kGravity) return body.v + (time - body.time) * accelerations_[path.slot];
    return body.v;
  }

  static Side& sideOf(Plan& plan, Slot slot) { return plan.sides[slot == plan.impact.a ? 0 : 1]; }
  static const Side& sideOf(const Plan& plan, Slot slot) {
    return plan.sides[slot == plan.impact.a ? 0 : 1];
  }

  static Slot partnerOf(const Path& path) {
    const Impact& impact = path.plan->impact;
    return path.slot == impact.a ? impact.b : impact.a;
  }

  BallId metBy(const Path& path) const {
    return path.plan != nullptr ? cards_[partnerOf(path)].id : cards_[path.slot].met;
  }

  std::uint32_t versionOf(const Path& path) const {
    return path.plan != nullptr ? path.plan->version : cards_[path.slot].version;
  }

  // Stores the place of now, for a change of velocity to start from.
  void settle(Slot slot) {
    Body& body = bodies_[slot];
    const Vec x = positionAt(slot, now_);
    body.v = velocityAt(slot, now_);
    body.x = x;
    body.time = now_;
    bringHome(slot);
  }

  // Takes the stored place into the periodic box by whole periods.
  void bringHome(Slot slot) { bodies_[slot].x = wrapped(bodies_[slot].x); }

  Vec wrapped(Vec x) const {
    using std::floor;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(period_[axis] > 0)) continue;
      const Real low = Real(surroundings_.box.min[axis]);
      const Real turns = floor((x[axis] - low) / period_[axis]);
      if (turns != 0) x[axis] -= turns * period_[axis];
      if (x[axis] < low) x[axis] += period_[axis];  // a rounding error out
      if (x[axis] >= low + period_[axis]) x[axis] = low;
    }
    return x;
  }

  Vec nearestImage(Vec dx) const {
    using std::floor;
    for (int axis = 0; axis < 3; ++axis) {
      if (period_[axis] > 0)
        dx[axis] -= floor(dx[axis] / period_[axis] + Real(0.5)) * period_[axis];
    }
    return dx;
  }

  // --- eras: all times count from the start of an era, so that they stay fine. An era ends at a
  // time that follows from the balls alone, whatever the frames.

  void changedFromOutside() {
    frame_open_ = false;
    era_is_stale_ = true;
  }

  void beginEra() {
    shiftClocks(now_);
    origin_ = reached_;
    now_ = 0;
    for (Slot slot = 0; slot < bodies_.size(); ++slot) {  // those changed, and few others
      if (bodies_[slot].time == 0) findWallVisit(slot);
    }
    era_ = nextEra();
    era_is_stale_ = false;
    layout_age_ = kFramesPerLayout;
    giveBackRoom();
  }

  // Vectors that grew ball by ball have up to twice the room that they need.
  void giveBackRoom() {
    const auto trim = [](auto& values) {
      if (values.capacity() > values.size() + values.size() / 4) values.shrink_to_fit();
    };
    forEachArray(trim);
    trim(slots_);
  }

  void turnEra() {
    shiftClocks(era_);
    origin_ = origin_ + double(era_);
    now_ = 0;
    // A place stored long ago would lose digits of its time.
    for (Slot slot = 0; slot < bodies_.size(); ++slot) {
      if (bodies_[slot].time < -kErasToSettle * era_) settle(slot);
    }
    era_ = nextEra();
  }

  void shiftClocks(Real by) {
    if (by == 0) return;
    watch_.setBack(by);
    for (Body& body : bodies_) body.time -= by;
    if (restitution_ < 1) {
      for (Card& card : cards_) card.history.last -= by;
    }
    for (WallVisit& visit : wall_visits_) visit.time -= by;
  }

  // A power of two, in which no ball moves by more than about its distance from the origin, or some
  // radii: then a time is no less fine than a place. Scales with the scene, exactly.
  Real nextEra() const {
    using std::abs;
    using std::sqrt;
    Real length = 0;
    for (const Body& body : bodies_) length = std::max(length, 16 * body.radius);
    Real quarter = kNever<Real>;
    for (int k = 0; k < 3; ++k) {
      if (period_[k] > 0) quarter = std::min(quarter, period_[k] / 4);
    }
    length = std::min(length, quarter);
    Real era = kNever<Real>;
    for (Slot slot = 0; slot < bodies_.size(); ++slot) {
      const Body& body = bodies_[slot];
      const Real own = std::min(std::max(length, body.x.cwiseAbs().maxCoeff()), quarter);
      Real pace = body.v.cwiseAbs().maxCoeff();
      if constexpr (kGravity) pace += sqrt(accelerations_[slot].cwiseAbs().maxCoeff() * own);
      if (pace * era > own) era = own / pace;
    }
    return era < kNever<Real> ? floorToPowerOfTwo(era) : era;
  }

  static Real floorToPowerOfTwo(Real x) {
    int exponent = 0;
    using std::frexp;
    using std::ldexp;
    (void)frexp(x, &exponent);
    return ldexp(Real(1), exponent - 1);
  }

  // --- frames

  // Finds all that happens from now to the end of a new frame.
  // @param limit  s, in this era: as far as anybody looks, if nothing moves
  void openFrame(Real limit) {
    WorkerPool& pool = bodies_.size() < kFewBalls ? alone_ : pool_;
    if (++layout_age_ > kFramesPerLayout) layOut();
    fillGrid(limit, pool);
    if (grid_.hasOutgrownItsCells()) {
      layOut();
      fillGrid(limit, pool);
    }
    if (++frames_since_renumbering_ >= kFramesPerRenumbering) renumber(pool);
    positions_.resize(bodies_.size());
    for (std::size_t p = 0; p < bodies_.size(); ++p) {
      positions_[grid_.slotAt(p)] = static_cast<std::uint32_t>(p);
    }
    findImpacts(pool);
    impacts_in_frame_ = pending_.size();
    frame_open_ = true;
  }

  // Begins a frame: so many of one length as it takes to the end of the era.
  void fillGrid(Real limit, WorkerPool& pool) {
    frame_start_ = now_;
    const Real left = era_ - now_;
    const Real frames = std::ceil(left / frame_length_ - Real(0.25));
    frame_end_ = frames > 1 ? now_ + left / frames : era_;
    if (!(frame_end_ < kNever<Real>)) frame_end_ = std::max(now_, limit);
    grid_.fill(
        bodies_.size(), [this](std::size_t i) { return sweptBallAtHome(static_cast<Slot>(i)); },
        pool);
    // Two paths that meet lie within four reaches, and a nearest image is nearer than half a
    // period.
    const Real near = Real(8 * grid_.reach());
    one_image_is_near_ = true;
    for (int k = 0; k < 3; ++k) {
      if (period_[k] > 0 && !(near < period_[k])) one_image_is_near_ = false;
    }
  }

  // A ball's path from its last change in this frame to the end of the frame.
  SweptBall sweptBall(const Path& path) const {
    using std::sqrt;
    const Real begin = std::max(path.body->time, frame_start_);
    const Real length = std::max(frame_end_ - begin, Real(0));
    const Vec x = placeAt(path, begin);
    Vec half = (length / 2) * speedAt(path, begin);
    SweptBall ball;
    ball.radius = double(path.body->radius);
    if constexpr (kGravity) {
      const Vec& a = accelerations_[path.slot];
      half += (length * length / 4) * a;
      ball.radius += double(length * length / 8 * sqrt(dot(a, a)));  // the bulge of the parabola
    }
    const Vec middle = x + half;
    for (std::size_t k = 0; k < 3; ++k) {
      ball.middle[k] = double(middle[static_cast<int>(k)]);
      ball.half[k] = double(half[static_cast<int>(k)]);
    }
    ball.half_length = double(sqrt(dot(half, half)));
    return ball;
  }

  // The same, with its middle in the periodic box.
  SweptBall sweptBallAtHome(Slot slot) const {
    SweptBall ball = sweptBall(pathOf(slot));
    if (surroundings_.periodic) {
      const Vec middle(Real(ball.middle[0]), Real(ball.middle[1]), Real(ball.middle[2]));
      const Vec home = wrapped(middle);
      for (std::size_t k = 0; k < 3; ++k) ball.middle[k] = double(home[static_cast<int>(k)]);
    }
    return ball;
  }

  // The same, in the image that the grid has taken the ball to until now.
  SweptBall sweptBallInGrid(const Path& path) const {
    SweptBall ball = sweptBall(path);
    if (surroundings_.periodic) {
      const std::array<int, 3> turns = turnsInGrid(ball, positions_[path.slot]);
      for (std::size_t k = 0; k < 3; ++k) {
        ball.middle[k] += turns[k] * double(period_[static_cast<int>(k)]);
      }
    }
    return ball;
  }

  // So many periods lies the image that the grid has of a ball from the one that its body tells.
  std::array<int, 3> turnsInGrid(const SweptBall& ball, std::size_t position) const {
    std::array<int, 3> turns = {0, 0, 0};
    const std::array<double, 3> middle = grid_.middleAt(position);
    for (std::size_t k = 0; k < 3; ++k) {
      const auto period = double(period_[static_cast<int>(k)]);
      if (period > 0) {
        turns[k] = static_cast<int>(std::floor((middle[k] - ball.middle[k]) / period + 0.5));
      }
    }
    return turns;
  }

  // Looks at how the balls are, to choose frames and cells for them.
  void layOut() {
    FrameSurvey survey;
    survey.planar = surroundings_.planar();
    for (Slot slot = 0; slot < bodies_.size(); ++slot) {
      const Vec v = velocityAt(slot, now_);
      using std::sqrt;
      survey.add(double(bodies_[slot].radius), double(sqrt(dot(v, v))));
    }
    const std::uint64_t impacts = statistics_.ball_collisions - collisions_at_layout_;
    const double elapsed = double(now_ - layout_time_) + (origin_ - layout_origin_);
    if (impacts > 0 && elapsed > 0) survey.impact_rate = double(impacts) / elapsed;
    collisions_at_layout_ = statistics_.ball_collisions;
    layout_time_ = now_;
    layout_origin_ = origin_;
    frame_start_ = frame_end_ = now_;
    const auto describe = [this](std::size_t i) { return sweptBallAtHome(static_cast<Slot>(i)); };
    grid_.survey(bodies_.size(), describe, survey.leastExtent());
    survey.volume = grid_.volume();
    frame_length_ = std::max(Real(frameLength(survey)), Real(0x1p-44) * era_);
    if (era_ < kNever<Real>) {
      frame_end_ = std::min(now_ + frame_length_, now_ + era_);
    }
    grid_.layOut(bodies_.size(), describe);
    layout_age_ = 0;
  }

  // Gives the balls new slots in the grid's order, so that neighbours in space are neighbours in
  // memory.
  void renumber(WorkerPool& pool) {
    frames_since_renumbering_ = 0;
    positions_.resize(bodies_.size());
    for (std::size_t p = 0; p < bodies_.size(); ++p) {
      positions_[grid_.slotAt(p)] = static_cast<std::uint32_t>(p);
    }
    for (Slot& slot : slots_) slot = positions_[slot];
    pool.run([&](unsigned w) {
      unsigned array = 0;
      forEachArray([&](auto& values) {
        if (array++ % pool.size() == w) moveToPlaces(values, positions_, workers_[w].moved);
      });
    });
    grid_.renumber();
  }

  void findImpacts(WorkerPool& pool) {
    pending_.clear();
    share(pool, bodies_.size(), [this](std::size_t begin, std::size_t end, Worker& worker) {
      worker.search.ahead_of = SweptSearch::kNoCell;  // of another frame
      findImpactsOf(begin, end, worker);
    });
    collectFound();
  }

  // Shares the work on 0..count-1 among threads, in order: f(begin, end, worker).
  template <class Function>
  void share(WorkerPool& pool, std::size_t count, const Function& f) {
    pool.run([&](unsigned w) {
      f(count * w / pool.size(), count * (w + 1) / pool.size(), workers_[w]);
    });
  }

  // All impacts in this frame of the balls at some positions of the grid, each pair's from one of
  // its ends.
  void findImpactsOf(std::size_t begin, std::size_t end, Worker& worker) const {
    inBatches(begin, end, [&](std::size_t first, std::size_t last) {
      for (std::size_t p = first; p < last; ++p) searchAhead(p, worker);
      meetPairs(worker);
      considerPairs(worker);
    });
  }

  void searchAhead(std::size_t p, Worker& worker) const {
    const Path path = pathOf(grid_.slotAt(p));
    considerWall(path, worker.found);
    const std::size_t level = grid_.levelAt(p);
    grid_.findAhead(p, level, worker.search);
    noteHits(path.slot, worker);
    for (std::size_t other = 0; other < grid_.levels(); ++other) {
      if (!grid_.seeks(level, other)) continue;
      grid_.findAround(other, sweptBallInGrid(path), worker.search);
      noteHits(path.slot, worker);
    }
  }

  // Notes where a search has found others, and asks memory who they are.
  void noteHits(Slot slot, Worker& worker) const {
    for (std::size_t i = 0; i < worker.search.count; ++i) {
      const LaneHit& hit = worker.search.hits[i];
      grid_.fetchSlot(hit.lane);
      worker.pairs.push_back({slot, hit.lane, {0, 0, 0}});
      if (!one_image_is_near_) worker.pairs.back().turns = grid_.imageOf(hit, worker.search);
    }
  }

  // Learns who they are, and asks memory for what they are.
  void meetPairs(Worker& worker) const {
    std::size_t kept = 0;
    for (Pair& pair : worker.pairs) {
      pair.other = grid_.slotAt(pair.other);
      if (pair.other == pair.slot) continue;
      touch(&bodies_[pair.other]);
      if (plans_left_ > 0) touch(&plan_of_[pair.other]);
      worker.pairs[kept++] = pair;
    }
    worker.pairs.resize(kept);
  }

  // The impacts of pairs as they are now.
  void considerPairs(Worker& worker) const {
    for (const Pair& pair : worker.pairs) {
      const Impact impact = meeting(pathOf(pair.slot), pathOf(pair.other), pair.turns);
      if (impact.time <= frame_end_) worker.found.push_back(impact);
    }
    worker.pairs.clear();
  }

  // What the workers have found is pending now.
  void collectFound() {
    for (Worker& worker : workers_) {
      pending_.insert(pending_.end(), worker.found.begin(), worker.found.end());
      worker.found.clear();
    }
  }

  // The impact of two balls on their paths, if neither changes before; its time is computed from
  // what they have stored alone, so that it is the same bits whenever it is asked.
  // @param turns  periods from where the grid has b to the image that was found
  Impact meeting(const Path& a, const Path& b, const std::array<int, 3>& turns) const {
    Impact impact;
    impact.a = a.slot;
    impact.b = b.slot;
    impact.image = {0, 0, 0};
    const Real start = std::max(a.body->time, b.body->time);
    Vec dx = placeAt(b, start) - placeAt(a, start);
    Vec dv = b.body->v - a.body->v;
    Vec da = Vec::Zero();
    if constexpr (kGravity) {
      dv = speedAt(b, start) - speedAt(a, start);
      da = accelerations_[b.slot] - accelerations_[a.slot];
    }
    if (surroundings_.periodic) {
      const Real later = std::max(frame_start_ - start, Real(0));
      impact.image = one_image_is_near_ ? nearestTurns(dx + later * dv + (later * later / 2) * da)
                                        : turnsBetween(a, b, turns);
      dx += shiftOf(impact.image);
    }
    const Real reach = a.body->radius + b.body->radius;
    if (kGravity && dot(da, da) > 0) {
      impact.time = start + timeOfImpactAccelerated<Real>(dx, dv, da, reach);
    } else {
      const Real wait = timeOfImpact<Real>(dx, dv, reach);
      const bool again = wait < kNever<Real> && haveJustMet(a, b, dx, reach);
      impact.time = again ? kNever<Real> : start + wait;
    }
    if (impact.time <= frame_end_) {
      impact.version_a = versionOf(a);
      impact.version_b = versionOf(b);
    }
    return impact;
  }

  // So many periods bring the nearest image of a ball to another, which lies at -dx.
  std::array<std::int16_t, 3> nearestTurns(const Vec& dx) const {
    using std::floor;
    std::array<std::int16_t, 3> turns = {0, 0, 0};
    for (int k = 0; k < 3; ++k) {
      if (!(period_[k] > 0)) continue;
      turns[static_cast<std::size_t>(k)] =
          static_cast<std::int16_t>(-floor(dx[k] / period_[k] + Real(0.5)));
    }
    return turns;
  }

  // The grid has found a pair in some image: which one is it of the places stored?
  std::array<std::int16_t, 3> turnsBetween(const Path& a, const Path& b,
                                           const std::array<int, 3>& seen) const {
    const std::array<int, 3> own = turnsInGrid(sweptBall(a), positions_[a.slot]);
    const std::array<int, 3> others = turnsInGrid(sweptBall(b), positions_[b.slot]);
    std::array<std::int16_t, 3> turns{};
    for (std::size_t k = 0; k < 3; ++k) {
      turns[k] = static_cast<std::int16_t>(seen[k] + others[k] - own[k]);
    }
    return turns;
  }

  Vec shiftOf(const std::array<std::int16_t, 3>& image) const {
    return {Real(image[0]) * period_[0], Real(image[1]) * period_[1], Real(image[2]) * period_[2]};
  }

  // In straight relative motion two balls that have just met do not meet again. In a periodic box
  // another image of the partner may be in reach too, but not in the same direction.
  bool haveJustMet(const Path& a, const Path& b, const Vec& dx, Real reach) const {
    const BallId id_a = cards_[a.slot].id, id_b = cards_[b.slot].id;
    if (metBy(a) != id_b || metBy(b) != id_a) return false;
    const Vec& normal = a.plan != nullptr ? a.plan->passed.normal : cards_[a.slot].met_normal;
    const Real along = dot(dx, normal);
    return dot(dx, dx) < reach * reach * Real(1 + 1e-6) &&
           (id_a < id_b ? along : -along) > Real(0.9) * reach;
  }

  // --- walls

  // When and where a ball, left to itself, meets its next wall.
  WallVisit wallVisit(Slot slot, const Body& body) const {
    WallVisit visit;
    if (isFixed(slot)) return visit;
    for (std::size_t k = 0; k < walls_.size(); ++k) {
      const Wall<Real>& wall = walls_[k];
      Real pull = 0;
      if constexpr (kGravity) {
        if (resting_[slot].includes(static_cast<int>(k))) continue;
        pull = dot(accelerations_[slot], wall.normal);
      }
      const Real gap = dot(body.x, wall.normal) - wall.offset - body.radius;
      const Real time = body.time + timeToWall<Real>(gap, dot(body.v, wall.normal), pull);
      if (time < visit.time) visit = {time, static_cast<std::uint32_t>(k)};
    }
    return visit;
  }

  void findWallVisit(Slot slot) {
    if (!walls_.empty()) wall_visits_[slot] = wallVisit(slot, bodies_[slot]);
  }

  // The next impact of a path with a wall; its time is kNever where there is none in this frame.
  Impact wallImpact(const Path& path) const {
    Impact impact;
    impact.time = kNever<Real>;
    if (walls_.empty()) return impact;
    const WallVisit& visit =
        path.plan != nullptr ? sideOf(*path.plan, path.slot).wall : wall_visits_[path.slot];
    if (!(visit.time <= frame_end_)) return impact;
    impact.time = visit.time;
    impact.a = path.slot;
    impact.b = kWall + visit.wall;
    impact.version_a = impact.version_b = versionOf(path);
    impact.image = {0, 0, 0};
    return impact;
  }

  void considerWall(const Path& path, std::vector<Impact>& found) const {
    const Impact impact = wallImpact(path);
    if (impact.time <= frame_end_) found.push_back(impact);
  }

  // --- impacts

  // Order of impacts: by time, then the smaller id (walls before all), then the larger.
  auto before() const {
    return [this](const Impact& first, const Impact& second) {
      if (first.time != second.time) return first.time < second.time;
      return namesOf(first) < namesOf(second);
    };
  }
  auto after() const {
    return [order = before()](const Impact& a, const Impact& b) { return order(b, a); };
  }

  std::pair<Partner, Partner> namesOf(const Impact& impact) const {
    const Partner a = cards_[impact.a].id;
    const Partner b = impact.b >= kWall ? walls_[impact.b - kWall].partner : cards_[impact.b].id;
    return {std::min(a, b), std::max(a, b)};
  }

  bool isStale(const Impact& impact) const {
    return cards_[impact.a].version != impact.version_a ||
           (impact.b < kWall && cards_[impact.b].version != impact.version_b);
  }

  // Takes all impacts up to a time, and those that follow from them.
  // @return false when `max_events` was not enough
  bool takeImpacts(Real until, std::uint64_t& max_events) {
    while (frame_open_) {
      slice_end_ = sliceEnd(until, max_events);
      gather();
      if (one_image_is_near_ && slice_.size() >= kFewImpacts && slice_.size() <= max_events) {
        makePlans();
      } else {
        for (const Impact& impact : slice_) push(impact);
      }
      if (!takeInOrder(max_events)) {
        if (max_events == 0) return false;
        continue;
      }
      if (frame_open_) now_ = slice_end_;
      if (slice_end_ >= until) return true;
    }
    return true;
  }

  // A slice of the frame so long that few of its impacts have to do with each other.
  Real sliceEnd(Real until, std::uint64_t max_events) const {
    const auto most = std::min(kImpactsPerBallAndSlice * static_cast<double>(bodies_.size()),
                               static_cast<double>(max_events / 2));
    const Real share = Real(std::max(most, double(kFewImpacts)) / double(impacts_in_frame_ + 1));
    const Real slices = std::ceil((until - now_) / (share * (frame_end_ - frame_start_)));
    const Real end = slices > 1 ? now_ + (until - now_) / slices : until;
    return end > now_ ? std::min(end, until) : until;
  }

  // Takes the impacts of the slice out of the pending ones; they stay in the order of the grid.
  void gather() {
    slice_.clear();
    std::size_t kept = 0;
    for (const Impact& impact : pending_) {
      if (impact.time > slice_end_) {
        pending_[kept++] = impact;
      } else if (!isStale(impact)) {
        slice_.push_back(impact);
      }
    }
    pending_.resize(kept);
  }

  void push(const Impact& impact) {
    waiting_.push_back(impact);
    std::push_heap(waiting_.begin(), waiting_.end(), after());
  }

  void pop() {
    std::pop_heap(waiting_.begin(), waiting_.end(), after());
    waiting_.pop_back();
  }

  // Takes what waits for its turn, the earliest first, and what follows up to the end of the slice;
  // then what is planned.
  // @return false when `max_events` was not enough
  bool takeInOrder(std::uint64_t& max_events) {
    while (!waiting_.empty()) {
      const Impact impact = waiting_.front();
      if (!isStale(impact) && max_events <= plans_left_) {
        settlePlans(&impact, max_events);
        pending_.insert(pending_.end(), waiting_.begin(), waiting_.end());
        waiting_.clear();
        return false;
      }
      pop();
      if (isStale(impact)) continue;
      --max_events;
      ++statistics_.events;
      now_ = std::max(now_, impact.time);
      fetchSoonest();
      impact.b < kWall ? takeBalls(impact) : takeWall(impact);
      if (!frame_open_) {
        settlePlans(&impact, max_events);
        waiting_.clear();
        return true;
      }
    }
    settlePlans(nullptr, max_events);
    return true;
  }

  // The first of the heap are among the next.
  void fetchSoonest() const {
    for (std::size_t i = 0; i < std::min(waiting_.size(), std::size_t{3}); ++i) {
      fetch(waiting_[i].a);
      if (waiting_[i].b < kWall) fetch(waiting_[i].b);
    }
  }

  // Puts a ball's place and velocity at the instant of an impact.
  Body bodyAt(Slot slot, Real time) const {
    return {positionAt(slot, time), velocityAt(slot, time), time, bodies_[slot].radius};
  }

  // What an impact of two balls leads to. Changes nothing.
  void foresee(Impact impact, Plan& plan) const {
    if (cards_[impact.b].id < cards_[impact.a].id) {
      std::swap(impact.a, impact.b);
      std::swap(impact.version_a, impact.version_b);
      for (std::int16_t& turns : impact.image) turns = static_cast<std::int16_t>(-turns);
    }
    plan.impact = impact;
    Side& a = plan.sides[0];
    Side& b = plan.sides[1];
    a.body = bodyAt(impact.a, impact.time);
    b.body = bodyAt(impact.b, impact.time);
    a.history = cards_[impact.a].history;
    b.history = cards_[impact.b].history;
    Vec dx = b.body.x - a.body.x;
    if (surroundings_.periodic) dx += shiftOf(impact.image);
    const Real reach = a.body.radius + b.body.radius;
    const Vec pressing = acceleration(impact.a) - acceleration(impact.b);
    plan.passed = meetBall<Real>(dx, reach, pressing, restitution_, impact.time,
                                 {a.body.v, inverseMass(impact.a), a.history},
                                 {b.body.v, inverseMass(impact.b), b.history});
    a.body.x = wrapped(a.body.x);
    b.body.x = wrapped(b.body.x);
  }

  void takeBalls(const Impact& found) {
    Plan& plan = at_hand_;
    foresee(found, plan);
    const Impact& impact = plan.impact;
    if (plan.passed.exchange.impulse > 0) {
      const Exchange<Real>& exchange = plan.passed.exchange;
      watch(impact.time,
            {cards_[impact.a].id, plan.sides[0].body.v, inverseMass(impact.a), exchange.change1},
            {cards_[impact.b].id, plan.sides[1].body.v, inverseMass(impact.b), exchange.change2},
            plan.passed.normal, exchange.approach_speed,
            plan.sides[0].body.radius + plan.sides[1].body.radius);
      if (log_ != nullptr) in_turn_.push_back({impact, collisionOf(plan)});
    }
    count(plan);
    for (const Slot slot : {impact.a, impact.b}) {
      bodies_[slot] = sideOf(plan, slot).body;
      velocityChanged(slot);
      putMet(slot, plan);
    }
    const SweptBall rest_a = changeWithinFrame(impact.a);
    const SweptBall rest_b = changeWithinFrame(impact.b);
    searchRest(impact.a, rest_a, impact);
    searchRest(impact.b, rest_b, impact);
  }

  // What a ball keeps in mind of an impact with another.
  void putMet(Slot slot, const Plan& plan) {
    Card& card = cards_[slot];
    card.history = sideOf(plan, slot).history;
    card.met = cards_[slot == plan.impact.a ? plan.impact.b : plan.impact.a].id;
    card.met_normal = plan.passed.normal;
  }

  void count(const Plan& plan) {
    if (!(plan.passed.exchange.impulse > 0)) return;
    ++statistics_.ball_collisions;
    statistics_.virial += double(plan.passed.exchange.impulse *
                                 (plan.sides[0].body.radius + plan.sides[1].body.radius));
    noteOverlap(plan.passed.overlap);
  }

  void takeWall(const Impact& impact) {
    const Slot slot = impact.a;
    const std::uint32_t index = impact.b - kWall;
    bodies_[slot] = bodyAt(slot, impact.time);
    Body& body = bodies_[slot];
    const Wall<Real>& wall = walls_[index];
    const Real pull = dot(acceleration(slot), wall.normal);
    const WallImpact<Real> passed =
        meetWall<Real>(wall, body.x, body.radius, pull, restitution_, body.time,
                       {body.v, inverseMass(slot), cards_[slot].history});
    noteOverlap(passed.overlap);
    if constexpr (kGravity) {
      if (passed.rests) resting_[slot].add(static_cast<int>(index));
    }
    if (passed.speed > 0) {
      ++statistics_.wall_collisions;
      const Vec at_rest = Vec::Zero();
      const Real change = (1 + passed.restitution) * passed.speed;
      watch(body.time, {cards_[slot].id, body.v, inverseMass(slot), change},
            {OrderWatch<Real>::wallKey(index), at_rest, 0, 0}, -wall.normal, passed.speed,
            body.radius);
      if (log_ != nullptr) {
        in_turn_.push_back(
            {impact, collision(impact, wall.partner, wrapped(body.x - body.radius * wall.normal),
                               -wall.normal, change * Real(cards_[slot].mass), passed.speed)});
      }
    }
    velocityChanged(slot);
    searchRest(slot, changeWithinFrame(slot), impact);
  }

  void watch(Real time, const typename OrderWatch<Real>::Side& a,
             const typename OrderWatch<Real>::Side& b, const Vec& normal, Real speed, Real reach) {
    if (watch_.note(time, a, b, normal, speed, reach, restitution_)) {
      ++statistics_.ambiguous_impacts;
    }
  }

  // After any change of velocity: impacts found with the old one are stale; walls rested on are
  // left or kept.
  void velocityChanged(Slot slot) {
    cards_[slot].version = ++last_version_;
    cards_[slot].met = kNobody;
    if constexpr (kGravity) {
      if (resting_[slot].count == 0) return;
      Body& body = bodies_[slot];
      accelerations_[slot] =
          settleContacts<Real>(resting_[slot], body.v, body.radius, gravity_, walls_);
    }
  }

  // Takes a ball's new path into the frame, or ends the frame if it leads too far for the grid.
  // @return the rest of its path
  SweptBall changeWithinFrame(Slot slot) {
    bringHome(slot);
    findWallVisit(slot);
    const SweptBall rest = sweptBallInGrid(pathOf(slot));
    if (frame_open_ && !grid_.change(positions_[slot], rest)) frame_open_ = false;
    return rest;
  }

  // Finds all impacts of a ball from its last change to the end of the frame.
  void searchRest(Slot slot, const SweptBall& rest, const Impact& now) {
    if (!frame_open_) return;
    Worker& worker = workers_.front();
    const Path path = pathOf(slot);
    considerWall(path, worker.found);
    for (std::size_t level = 0; level < grid_.levels(); ++level) {
      grid_.findAroundLater(level, rest, worker.search);
      noteHits(slot, worker);
    }
    meetPairs(worker);
    if (plans_left_ > 0) {
      dropMet(path, now, worker);
      for (const Pair& pair : worker.pairs) {
        if (plan_of_[pair.other] == kNoPlan) continue;
        const Impact impact = meeting(path, plannedPathOf(pair.other), pair.turns);
        if (impact.time <= frame_end_) worker.found.push_back(impact);
      }
    }
    considerPairs(worker);
    for (const Impact& impact : worker.found) {
      if (impact.time > slice_end_) {
        pending_.push_back(impact);
      } else {
        push(impact);
      }
    }
    worker.found.clear();
  }

  // --- plans

  // Plans what can be planned of the slice; the rest waits.
  void makePlans() {
    chooseLone();
    plans_left_ = plan_count_ = lone_.size();
    if (plans_.size() < plan_count_) plans_.resize(plan_count_ + plan_count_ / 4);
    for (std::size_t i = 0; i < plan_count_; ++i) plans_[i].version = ++last_version_;
    share(planners(), plan_count_, [this](std::size_t begin, std::size_t end, Worker&) {
      inBatches(begin, end, [this](std::size_t first, std::size_t last) { draw(first, last); });
    });
    share(planners(), plan_count_, [this](std::size_t begin, std::size_t end, Worker& worker) {
      inBatches(begin, end, [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i) search(plans_[i], worker);
        meetPairs(worker);
        considerPlans(worker);
      });
    });
    collectFound();
    for (Worker& worker : workers_) {
      for (const std::uint32_t i : worker.disturbed) drop(i);
      worker.disturbed.clear();
    }
  }

  WorkerPool& planners() { return plan_count_ < kFewPlans ? alone_ : pool_; }

  template <class Function>
  static void inBatches(std::size_t begin, std::size_t end, const Function& f) {
    for (; begin < end; begin += kBatch) f(begin, std::min(begin + kBatch, end));
  }

  // Sorts out the impacts of the slice that share no ball; the others wait for their turn.
  void chooseLone() {
    plan_of_.resize(bodies_.size(), kNoPlan);
    lone_.clear();
    const auto forBalls = [](const Impact& impact, auto f) {
      f(impact.a);
      if (impact.b < kWall) f(impact.b);
    };
    for (const Impact& impact : slice_) {
      forBalls(impact, [this](Slot slot) {
        plan_of_[slot] = plan_of_[slot] == kNoPlan ? kOnePlan : kManyPlans;
      });
    }
    for (const Impact& impact : slice_) {
      if (isLone(impact)) {
        lone_.push_back(impact);
      } else {
        push(impact);
      }
    }
    for (const Impact& impact : waiting_) {
      forBalls(impact, [this](Slot slot) { plan_of_[slot] = kNoPlan; });
    }
    for (std::size_t i = 0; i < lone_.size(); ++i) {
      plan_of_[lone_[i].a] = plan_of_[lone_[i].b] = static_cast<std::uint32_t>(i);
    }
  }

  // Balls that rest on walls are left to takeBalls().
  bool isLone(const Impact& impact) const {
    if (impact.b >= kWall) return false;
    if constexpr (kGravity) {
      if (resting_[impact.a].count > 0 || resting_[impact.b].count > 0) return false;
    }
    return plan_of_[impact.a] == kOnePlan && plan_of_[impact.b] == kOnePlan;
  }

  // Computes some plans, and lets the grid show both paths of their balls.
  void draw(std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      fetch(lone_[i].a);
      fetch(lone_[i].b);
    }
    for (std::size_t i = begin; i < end; ++i) {
      grid_.fetch(positions_[lone_[i].a]);
      grid_.fetch(positions_[lone_[i].b]);
    }
    for (std::size_t i = begin; i < end; ++i) draw(plans_[i], lone_[i]);
  }

  // Fetches from memory what an impact of a ball will need.
  void fetch(Slot slot) const {
    touch(&bodies_[slot]);
    touch(&cards_[slot]);
    touch(&positions_[slot]);
    if (!walls_.empty()) touch(&wall_visits_[slot]);
  }

  void draw(Plan& plan, const Impact& impact) {
    foresee(impact, plan);
    plan.state = Plan::State::open;
    for (const Slot slot : {plan.impact.a, plan.impact.b}) {
      Side& side = sideOf(plan, slot);
      if (!walls_.empty()) side.wall = wallVisit(slot, side.body);
      const SweptBall rest = sweptBallInGrid({slot, &side.body, &plan});
      if (!grid_.add(positions_[slot], rest)) plan.state = Plan::State::leads_too_far;
    }
  }

  // Finds whom the balls of a plan may meet.
  void search(const Plan& plan, Worker& worker) const {
    if (plan.state != Plan::State::open) worker.disturbed.push_back(plan_of_[plan.impact.a]);
    for (const Slot slot : {plan.impact.a, plan.impact.b}) {
      const Path path = {slot, &sideOf(plan, slot).body, &plan};
      noteImpact(wallImpact(path), worker);
      const SweptBall rest = sweptBallInGrid(path);
      for (std::size_t level = 0; level < grid_.levels(); ++level) {
        grid_.findAroundLater(level, rest, worker.search);
        noteHits(slot, worker);
      }
    }
  }

  // What planned paths meet: others as they are now, and as they are planned, each two once.
  void considerPlans(Worker& worker) const {
    for (const Pair& pair : worker.pairs) {
      const Path path = plannedPathOf(pair.slot);
      if (pair.other != partnerOf(path)) {
        noteImpact(meeting(path, pathOf(pair.other), pair.turns), worker);
      }
      if (plan_of_[pair.other] != kNoPlan && pair.slot < pair.other) {
        noteImpact(meeting(path, plannedPathOf(pair.other), pair.turns), worker);
      }
    }
    worker.pairs.clear();
  }

  // Notes an impact that plans lead to: within the slice they do not hold.
  void noteImpact(const Impact& impact, Worker& worker) const {
    if (impact.time > slice_end_) {
      if (impact.time <= frame_end_) worker.found.push_back(impact);
      return;
    }
    for (const Slot slot : {impact.a, impact.b}) {
      if (slot < kWall && plan_of_[slot] != kNoPlan) worker.disturbed.push_back(plan_of_[slot]);
    }
  }

  Path plannedPathOf(Slot slot) const {
    const Plan& plan = plans_[plan_of_[slot]];
    return {slot, &sideOf(plan, slot).body, &plan};
  }

  // Ends the plans that a new path meets within the slice, at an impact of now: those that are
  // earlier have come true, the others wait for their turn.
  void dropMet(const Path& path, const Impact& now, const Worker& worker) {
    for (const Pair& pair : worker.pairs) {
      const std::uint32_t index = plan_of_[pair.other];
      if (index == kNoPlan) continue;
      if (meeting(path, plannedPathOf(pair.other), pair.turns).time > slice_end_ &&
          meeting(path, pathOf(pair.other), pair.turns).time > slice_end_) {
        continue;
      }
      if (before()(plans_[index].impact, now)) {
        comeTrue(plans_[index]);
      } else {
        drop(index);
      }
    }
  }

  // Ends a plan: its impact waits for its turn.
  void drop(std::uint32_t index) {
    Plan& plan = plans_[index];
    if (plan.state == Plan::State::dropped) return;
    plan.state = Plan::State::dropped;
    plan_of_[plan.impact.a] = plan_of_[plan.impact.b] = kNoPlan;
    --plans_left_;
    push(plan.impact);
  }

  void comeTrue(Plan& plan) {
    plan.state = Plan::State::came_true;
    for (const Slot slot : {plan.impact.a, plan.impact.b}) {
      const Side& side = sideOf(plan, slot);
      bodies_[slot] = side.body;
      cards_[slot].version = plan.version;
      putMet(slot, plan);
      if (!walls_.empty()) wall_visits_[slot] = side.wall;
      plan_of_[slot] = kNoPlan;
    }
  }

  // Lets the plans come true that are left: all, or those before `bound`; then the others are
  // pending again.
  void settlePlans(const Impact* bound, std::uint64_t& max_events) {
    if (bound != nullptr && plans_left_ > 0) {
      for (std::uint32_t i = 0; i < plan_count_; ++i) {
        Plan& plan = plans_[i];
        if (plan.state != Plan::State::open || before()(plan.impact, *bound)) continue;
        drop(i);
      }
    }
    share(planners(), plan_count_, [this](std::size_t begin, std::size_t end, Worker&) {
      for (std::size_t i = begin; i < end; ++i) {
        if (plans_[i].state == Plan::State::open) comeTrue(plans_[i]);
      }
    });
    for (std::size_t i = 0; i < plan_count_; ++i) {
      if (plans_[i].state != Plan::State::came_true) continue;
      count(plans_[i]);
      now_ = std::max(now_, plans_[i].impact.time);
    }
    statistics_.events += plans_left_;
    max_events -= plans_left_;
    report();
    plan_count_ = plans_left_ = 0;
  }

  // --- bookkeeping

  void noteOverlap(Real overlap) {
    statistics_.deepest_overlap = std::max(statistics_.deepest_overlap, double(overlap));
  }

  Collision collisionOf(const Plan& plan) const {
    const Body& a = plan.sides[0].body;
    const Vec point = wrapped(a.x + a.radius * plan.passed.normal);
    return collision(plan.impact, cards_[plan.impact.b].id, point, plan.passed.normal,
                     plan.passed.exchange.impulse, plan.passed.exchange.approach_speed);
  }

  Collision collision(const Impact& impact, Partner b, const Vec& point, const Vec& normal,
                      Real impulse, Real speed) const {
    Collision collision;
    collision.time = origin_ + double(impact.time);
    collision.a = cards_[impact.a].id;
    collision.b = b;
    collision.point = point.template cast<double>();
    collision.normal = normal.template cast<double>();
    collision.impulse = double(impulse);
    collision.approach_speed = double(speed);
    return collision;
  }

  // Logs what happened in the slice in order of time: of the impacts in turn, each after what led
  // to it, and of the plans.
  void report() {
    if (log_ == nullptr) return;
    happened_.clear();
    for (std::uint32_t i = 0; i < plan_count_; ++i) {
      const Plan& plan = plans_[i];
      if (plan.state == Plan::State::came_true && plan.passed.exchange.impulse > 0) {
        happened_.push_back(i);
      }
    }
    std::sort(happened_.begin(), happened_.end(), [this](std::uint32_t a, std::uint32_t b) {
      return before()(plans_[a].impact, plans_[b].impact);
    });
    std::size_t next = 0;
    for (const Reported& reported : in_turn_) {
      while (next < happened_.size() && before()(plans_[happened_[next]].impact, reported.impact)) {
        log_->add(collisionOf(plans_[happened_[next++]]));
      }
      log_->add(reported.collision);
    }
    while (next < happened_.size()) log_->add(collisionOf(plans_[happened_[next++]]));
    in_turn_.clear();
  }

  Surroundings surroundings_;
  Vec gravity_;
  Real restitution_;
  std::vector<Wall<Real>> walls_;
  Vec period_ = Vec::Zero();  // m; 0: that axis does not wrap

  // One entry a slot: 0 .. number of balls.
  HugePageVector<Body> bodies_;
  HugePageVector<Card> cards_;
  HugePageVector<Vec> accelerations_;  // m/s^2; only with gravity
  std::vector<RestingContacts> resting_;
  std::vector<WallVisit> wall_visits_;  // only with walls
  std::vector<Slot> slots_;             // by ascending id

  // The frame.
  bool frame_open_ = false;
  Real frame_start_ = 0;  // s, in this era
  Real frame_end_ = 0;    // s, in this era
  SweptGrid grid_;
  HugePageVector<std::uint32_t> positions_;  // in the grid, by slot
  bool one_image_is_near_ = true;            // of any ball to another that it may meet
  std::vector<Impact> pending_;              // found, and not looked at since
  std::size_t impacts_in_frame_ = 0;         // found at its start

  // The slice.
  Real slice_end_ = 0;           // s, in this era
  std::vector<Impact> slice_;    // its impacts
  std::vector<Impact> waiting_;  // those taken in turn: a heap, the earliest first
  std::vector<Impact> lone_;     // those planned
  std::vector<Plan> plans_;      // of which plan_count_ are of this slice
  std::size_t plan_count_ = 0;
  std::size_t plans_left_ = 0;           // of these, not dropped
  std::vector<std::uint32_t> plan_of_;   // by slot
  Plan at_hand_;                         // of the impact that is taken
  std::uint32_t last_version_ = 0;       // given to a ball
  std::vector<Reported> in_turn_;        // to be logged
  std::vector<std::uint32_t> happened_;  // plans, to be logged

  WorkerPool pool_;
  WorkerPool alone_;
  std::vector<Worker> workers_;  // one a thread

  // How frames and cells were chosen.
  Real frame_length_ = 0;                        // s
  std::uint32_t layout_age_ = kFramesPerLayout;  // frames
  std::uint32_t frames_since_renumbering_ = kFramesPerRenumbering;
  std::uint64_t collisions_at_layout_ = 0;
  Real layout_time_ = 0;  // s, in the era that began at layout_origin_
  Time layout_origin_;

  Time origin_;   // when this era began
  Real era_ = 0;  // s, its length
  bool era_is_stale_ = true;
  Real now_ = 0;  // s, in this era
  Time reached_;  // what now() tells
  OrderWatch<Real> watch_{surroundings_.gravity};
  Statistics statistics_;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
