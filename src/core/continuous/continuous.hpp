// Method continuous: frame by frame, and inside a frame every impact at its own time, earliest
// first, until none is left.
//
// At the start of a frame all balls are put into a grid by place, and all pairs whose paths over
// the frame come near enough are found in one pass through memory (swept_grid.hpp), which the
// threads share. The few impacts inside the frame are taken in order of time; after each its
// partners are searched anew for the rest of the frame. No queue outlives the frame, and nothing
// happens when a ball passes from cell to cell.
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
        finders_(threads) {
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
    statistics.queue_depth = agenda_.size() - next_ + later_.size();
    statistics.bytes = grid_.bytes() + capacityBytes(bodies_) + capacityBytes(cards_) +
                       capacityBytes(accelerations_) + capacityBytes(resting_) +
                       capacityBytes(wall_visits_) + capacityBytes(slots_) +
                       capacityBytes(positions_) + capacityBytes(agenda_) + capacityBytes(later_);
    for (const Finder& finder : finders_) statistics.bytes += capacityBytes(finder.found);
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
    std::uint32_t version = 0;  // counts the changes of this ball's path
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

  // What one thread needs to search.
  struct alignas(64) Finder {
    SweptSearch search;
    std::vector<Impact> found;
  };

  static constexpr BallId kNobody = ~BallId{0};
  static constexpr std::uint32_t kWall = 0xF8000000;
  static constexpr std::uint32_t kFramesPerLayout = 64;
  static constexpr std::uint32_t kFramesPerRenumbering = 4;
  static constexpr std::size_t kFewBalls = 2000;  // not worth waking threads for
  static constexpr int kErasToSettle = 16;
  static constexpr std::size_t kSoon = 12;  // impacts ahead
  static constexpr std::size_t kSooner = 6;

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

  Vec positionAt(Slot slot, Real time) const {
    const Body& body = bodies_[slot];
    const Real dt = time - body.time;
    if constexpr (kGravity) return body.x + dt * (body.v + (dt / 2) * accelerations_[slot]);
    return body.x + dt * body.v;
  }

  Vec velocityAt(Slot slot, Real time) const {
    const Body& body = bodies_[slot];
    if constexpr (kGravity) return body.v + (time - body.time) * accelerations_[slot];
    return body.v;
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
    if (++frames_since_renumbering_ >= kFramesPerRenumbering) renumber();
    positions_.resize(bodies_.size());
    for (std::size_t p = 0; p < bodies_.size(); ++p) {
      positions_[grid_.slotAt(p)] = static_cast<std::uint32_t>(p);
    }
    findImpacts(pool);
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
  }

  // A ball's path from its last change in this frame to the end of the frame.
  SweptBall sweptBall(Slot slot) const {
    using std::sqrt;
    const Real begin = std::max(bodies_[slot].time, frame_start_);
    const Real length = std::max(frame_end_ - begin, Real(0));
    const Vec x = positionAt(slot, begin);
    Vec half = (length / 2) * velocityAt(slot, begin);
    SweptBall ball;
    ball.radius = double(bodies_[slot].radius);
    if constexpr (kGravity) {
      const Vec& a = accelerations_[slot];
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
    SweptBall ball = sweptBall(slot);
    if (surroundings_.periodic) {
      const Vec middle(Real(ball.middle[0]), Real(ball.middle[1]), Real(ball.middle[2]));
      const Vec home = wrapped(middle);
      for (std::size_t k = 0; k < 3; ++k) ball.middle[k] = double(home[static_cast<int>(k)]);
    }
    return ball;
  }

  // The same, in the image that the grid has taken the ball to until now.
  SweptBall sweptBallInGrid(Slot slot) const {
    SweptBall ball = sweptBall(slot);
    if (surroundings_.periodic) {
      const std::array<int, 3> turns = turnsInGrid(ball, positions_[slot]);
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
  void renumber() {
    frames_since_renumbering_ = 0;
    positions_.resize(bodies_.size());
    for (std::size_t p = 0; p < bodies_.size(); ++p) {
      positions_[grid_.slotAt(p)] = static_cast<std::uint32_t>(p);
    }
    for (Slot& slot : slots_) slot = positions_[slot];
    // Cycle by cycle: what is at i belongs at positions_[i].
    for (Slot i = 0; i < positions_.size(); ++i) {
      while (positions_[i] != i) {
        const Slot to = positions_[i];
        forEachArray([&](auto& values) { std::swap(values[i], values[to]); });
        std::swap(positions_[i], positions_[to]);
      }
    }
    grid_.renumber();
  }

  void findImpacts(WorkerPool& pool) {
    agenda_.clear();
    later_.clear();
    next_ = 0;
    const std::size_t count = bodies_.size();
    pool.run([&](unsigned worker) {
      Finder& finder = finders_[worker];
      finder.found.clear();
      finder.search.ahead_of = SweptSearch::kNoCell;  // of another frame
      findImpactsOf(count * worker / pool.size(), count * (worker + 1) / pool.size(), finder.search,
                    worker == 0 ? agenda_ : finder.found);
    });
    for (unsigned worker = 1; worker < pool.size(); ++worker) {
      const std::vector<Impact>& found = finders_[worker].found;
      agenda_.insert(agenda_.end(), found.begin(), found.end());
    }
    std::sort(agenda_.begin(), agenda_.end(), before());
  }

  // All impacts in this frame of the balls at some positions of the grid, each pair's from one of
  // its ends.
  void findImpactsOf(std::size_t begin, std::size_t end, SweptSearch& search,
                     std::vector<Impact>& found) const {
    for (std::size_t p = begin; p < end; ++p) {
      const Slot slot = grid_.slotAt(p);
      considerWall(slot, found);
      const std::size_t level = grid_.levelAt(p);
      grid_.findAhead(p, level, search);
      considerHits(slot, search, found);
      for (std::size_t other = 0; other < grid_.levels(); ++other) {
        if (!grid_.seeks(level, other)) continue;
        grid_.findAround(other, sweptBallInGrid(slot), search);
        considerHits(slot, search, found);
      }
    }
  }

  void considerHits(Slot slot, const SweptSearch& search, std::vector<Impact>& found) const {
    for (std::size_t i = 0; i < search.count; ++i) {
      const LaneHit& hit = search.hits[i];
      Impact impact;
      impact.a = slot;
      impact.b = grid_.slotAt(hit.lane);
      if (impact.b == slot) continue;
      impact.image = {0, 0, 0};
      if (surroundings_.periodic) impact.image = imageOf(impact, hit, search);
      impact.time = timeOf(impact);
      if (!(impact.time <= frame_end_)) continue;
      impact.version_a = cards_[slot].version;
      impact.version_b = cards_[impact.b].version;
      found.push_back(impact);
    }
  }

  // The grid has found a pair in some image: which one is it of the places stored?
  std::array<std::int16_t, 3> imageOf(const Impact& impact, const LaneHit& hit,
                                      const SweptSearch& search) const {
    const std::array<int, 3> seen = grid_.imageOf(hit, search);
    const std::array<int, 3> own = turnsInGrid(sweptBall(impact.a), positions_[impact.a]);
    const std::array<int, 3> others = turnsInGrid(sweptBall(impact.b), positions_[impact.b]);
    std::array<std::int16_t, 3> image{};
    for (std::size_t k = 0; k < 3; ++k) {
      image[k] = static_cast<std::int16_t>(seen[k] + others[k] - own[k]);
    }
    return image;
  }

  Vec shiftOf(const std::array<std::int16_t, 3>& image) const {
    return {Real(image[0]) * period_[0], Real(image[1]) * period_[1], Real(image[2]) * period_[2]};
  }

  // When a pair meets, if neither changes before: from what they have stored, so that it is the
  // same bits whenever it is asked.
  Real timeOf(const Impact& impact) const {
    const Body& a = bodies_[impact.a];
    const Body& b = bodies_[impact.b];
    const Real start = std::max(a.time, b.time);
    Vec dx = positionAt(impact.b, start) - positionAt(impact.a, start);
    if (surroundings_.periodic) dx += shiftOf(impact.image);
    const Real reach = a.radius + b.radius;
    Vec dv = b.v - a.v;
    if constexpr (kGravity) {
      dv = velocityAt(impact.b, start) - velocityAt(impact.a, start);
      const Vec da = accelerations_[impact.b] - accelerations_[impact.a];
      if (dot(da, da) > 0) return start + timeOfImpactAccelerated<Real>(dx, dv, da, reach);
    }
    const Real wait = timeOfImpact<Real>(dx, dv, reach);
    if (wait < kNever<Real> && haveJustMet(impact, dx, reach)) return kNever<Real>;
    return start + wait;
  }

  // In straight relative motion two balls that have just met do not meet again. In a periodic box
  // another image of the partner may be in reach too, but not in the same direction.
  bool haveJustMet(const Impact& impact, const Vec& dx, Real reach) const {
    const Card& a = cards_[impact.a];
    const Card& b = cards_[impact.b];
    if (a.met != b.id || b.met != a.id) return false;
    const Real along = dot(dx, a.met_normal);
    return dot(dx, dx) < reach * reach * Real(1 + 1e-6) &&
           (a.id < b.id ? along : -along) > Real(0.9) * reach;
  }

  // --- walls

  // When and where a ball, left to itself, meets its next wall.
  void findWallVisit(Slot slot) {
    if (walls_.empty()) return;
    WallVisit& visit = wall_visits_[slot];
    visit = {};
    if (isFixed(slot)) return;
    const Body& body = bodies_[slot];
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
  }

  void considerWall(Slot slot, std::vector<Impact>& found) const {
    if (walls_.empty() || !(wall_visits_[slot].time <= frame_end_)) return;
    Impact impact;
    impact.time = wall_visits_[slot].time;
    impact.a = slot;
    impact.b = kWall + wall_visits_[slot].wall;
    impact.version_a = impact.version_b = cards_[slot].version;
    impact.image = {0, 0, 0};
    found.push_back(impact);
  }

  // --- impacts

  // Order of impacts: by time, then the smaller id (walls before all), then the larger.
  auto before() const {
    return [this](const Impact& first, const Impact& second) {
      if (first.time != second.time) return first.time < second.time;
      return namesOf(first) < namesOf(second);
    };
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
    const auto after = [order = before()](const Impact& a, const Impact& b) { return order(b, a); };
    while (frame_open_) {
      const bool has_planned = next_ < agenda_.size();
      const bool takes_later =
          !later_.empty() && (!has_planned || before()(later_.front(), agenda_[next_]));
      if (!takes_later && !has_planned) return true;
      const Impact impact = takes_later ? later_.front() : agenda_[next_];
      const bool stale = isStale(impact);
      if (!stale && impact.time > until) return true;
      if (!stale && max_events == 0) return false;
      if (takes_later) {
        std::pop_heap(later_.begin(), later_.end(), after);
        later_.pop_back();
      } else {
        ++next_;
      }
      expect(next_);
      if (stale) continue;
      --max_events;
      ++statistics_.events;
      now_ = std::max(now_, impact.time);
      impact.b < kWall ? takeBalls(impact) : takeWall(impact.a, impact.b - kWall);
    }
    return true;
  }

  // Fetches from memory what the impacts soon after will need: first what tells where the rest is.
  void expect(std::size_t next) const {
    if (next + kSoon < agenda_.size()) {
      const Impact& soon = agenda_[next + kSoon];
      for (const Slot slot : {soon.a, soon.b}) {
        if (slot >= kWall) continue;
        __builtin_prefetch(&bodies_[slot]);
        __builtin_prefetch(&cards_[slot]);
        __builtin_prefetch(&positions_[slot]);
      }
    }
    if (next + kSooner < agenda_.size()) {
      grid_.prefetch(positions_[agenda_[next + kSooner].a]);
    }
  }

  // Puts a ball's place and velocity at the instant of an impact.
  void settleAt(Slot slot, Real time) {
    Body& body = bodies_[slot];
    const Vec x = positionAt(slot, time);
    body.v = velocityAt(slot, time);
    body.x = x;
    body.time = time;
  }

  void takeBalls(Impact impact) {
    if (cards_[impact.b].id < cards_[impact.a].id) {
      std::swap(impact.a, impact.b);
      for (std::int16_t& turns : impact.image) turns = static_cast<std::int16_t>(-turns);
    }
    settleAt(impact.a, impact.time);
    settleAt(impact.b, impact.time);
    Body& a = bodies_[impact.a];
    Body& b = bodies_[impact.b];
    Card& card_a = cards_[impact.a];
    Card& card_b = cards_[impact.b];
    Vec dx = b.x - a.x;
    if (surroundings_.periodic) dx += shiftOf(impact.image);
    const Real reach = a.radius + b.radius;
    const Vec pressing = acceleration(impact.a) - acceleration(impact.b);
    const BallImpact<Real> passed = meetBall<Real>(dx, reach, pressing, restitution_, impact.time,
                                                   {a.v, inverseMass(impact.a), card_a.history},
                                                   {b.v, inverseMass(impact.b), card_b.history});
    if (passed.exchange.impulse > 0) {
      ++statistics_.ball_collisions;
      statistics_.virial += double(passed.exchange.impulse * reach);
      noteOverlap(passed.overlap);
      watch(impact.time, {card_a.id, a.v, inverseMass(impact.a), passed.exchange.change1},
            {card_b.id, b.v, inverseMass(impact.b), passed.exchange.change2}, passed.normal,
            passed.exchange.approach_speed, reach);
      report(impact, card_b.id, passed.normal, passed.exchange.impulse,
             passed.exchange.approach_speed);
    }
    velocityChanged(impact.a);
    velocityChanged(impact.b);
    card_a.met = card_b.id;
    card_b.met = card_a.id;
    card_a.met_normal = card_b.met_normal = passed.normal;
    const SweptBall rest_a = changeWithinFrame(impact.a);
    const SweptBall rest_b = changeWithinFrame(impact.b);
    searchRest(impact.a, rest_a);
    searchRest(impact.b, rest_b);
  }

  void takeWall(Slot slot, std::uint32_t index) {
    settleAt(slot, wall_visits_[slot].time);
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
      Impact impact;
      impact.time = body.time;
      impact.a = slot;
      const Vec at_rest = Vec::Zero();
      const Real change = (1 + passed.restitution) * passed.speed;
      watch(body.time, {cards_[slot].id, body.v, inverseMass(slot), change},
            {OrderWatch<Real>::wallKey(index), at_rest, 0, 0}, -wall.normal, passed.speed,
            body.radius);
      report(impact, wall.partner, -wall.normal, change * Real(cards_[slot].mass), passed.speed);
    }
    velocityChanged(slot);
    searchRest(slot, changeWithinFrame(slot));
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
    ++cards_[slot].version;
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
    const SweptBall rest = sweptBallInGrid(slot);
    if (frame_open_ && !grid_.change(positions_[slot], rest)) frame_open_ = false;
    return rest;
  }

  // Finds all impacts of a ball from its last change to the end of the frame.
  void searchRest(Slot slot, const SweptBall& rest) {
    if (!frame_open_) return;
    Finder& finder = finders_.front();
    finder.found.clear();
    considerWall(slot, finder.found);
    for (std::size_t level = 0; level < grid_.levels(); ++level) {
      grid_.findAroundLater(level, rest, finder.search);
      considerHits(slot, finder.search, finder.found);
    }
    const auto after = [order = before()](const Impact& a, const Impact& b) { return order(b, a); };
    for (const Impact& impact : finder.found) {
      later_.push_back(impact);
      std::push_heap(later_.begin(), later_.end(), after);
    }
  }

  // --- bookkeeping

  void noteOverlap(Real overlap) {
    statistics_.deepest_overlap = std::max(statistics_.deepest_overlap, double(overlap));
  }

  void report(const Impact& impact, Partner b, const Vec& n, Real impulse, Real speed) {
    if (log_ == nullptr) return;
    const Body& body = bodies_[impact.a];
    Collision collision;
    collision.time = origin_ + double(impact.time);
    collision.a = cards_[impact.a].id;
    collision.b = b;
    collision.point = wrapped(body.x + body.radius * n).template cast<double>();
    collision.normal = n.template cast<double>();
    collision.impulse = double(impulse);
    collision.approach_speed = double(speed);
    log_->add(collision);
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
  std::vector<Impact> agenda_;               // found at the start, in order
  std::size_t next_ = 0;                     // in agenda_
  std::vector<Impact> later_;                // found since: a heap, the earliest first
  WorkerPool pool_;
  WorkerPool alone_;
  std::vector<Finder> finders_;  // one a thread

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
  OrderWatch<Real> watch_;
  Statistics statistics_;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
