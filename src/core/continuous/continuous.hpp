// Method continuous: frame by frame, and inside a frame every impact at its own time, earliest
// first, until none is left. No queue outlives the frame, and nothing happens when a ball passes
// from cell to cell.
//
// At the start of a frame one pass through memory, which the threads share, finds all impacts
// within it. They are taken slice of time by slice. Those of a slice that have nothing to do with
// each other are planned, side by side; the others are taken in order of time. After each impact
// its partners are searched anew for the rest of the frame.
//
//   balls.hpp             on what path each ball goes
//   periodic_box.hpp      images in space that repeats
//   era_length.hpp        from when its times count
//   frame.hpp             when a frame ends, and the grid of all paths in it (swept_grid.hpp)
//   impact_search.hpp     the impacts that paths lead to
//   impacts.hpp           which comes first, and what it leads to
//   plans.hpp             impacts computed side by side
//   buffer.hpp            room for what lasts a slice or a frame
//   collision_report.hpp  the log, in order of time
//   exact_sum.hpp         the virial, whatever the order
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
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "ball_sim/method.hpp"
#include "ball_sim/simultaneous_impacts.hpp"
#include "ball_sim/walls.hpp"
#include "continuous/balls.hpp"
#include "continuous/buffer.hpp"
#include "continuous/collision_report.hpp"
#include "continuous/era_length.hpp"
#include "continuous/exact_sum.hpp"
#include "continuous/frame.hpp"
#include "continuous/impact_search.hpp"
#include "continuous/impacts.hpp"
#include "continuous/plans.hpp"
#include "continuous/worker_pool.hpp"
#include "impact.hpp"

namespace ball_sim::core::continuous {

/// @tparam Real      double or long double
/// @tparam kGravity  whether balls fall; without it no acceleration is stored or computed
template <class Real, bool kGravity>
class Continuous final : public Method {
  using Vec = VectorOf<Real>;

 public:
  /// @param threads  >= 1
  Continuous(const Surroundings& surroundings, unsigned threads)
      : pools_(threads),
        balls_(surroundings),
        frame_(surroundings, balls_),
        search_(balls_, frame_, threads),
        plans_(balls_, frame_, search_, pools_),
        waiting_(balls_),
        report_(balls_),
        watch_(surroundings.gravity) {}

  const char* name() const override { return "continuous"; }

  void insert(BallId id, const Ball& ball) override {
    assert(balls_.slots.empty() || balls_.cards[balls_.slots.back()].id < id);
    balls_.insert(id, ball, now_);
    changedFromOutside();
  }

  void remove(BallId id) override {
    balls_.remove(id);
    frame_.close();
  }

  void setMotion(BallId id, const Vector3& position, const Vector3& velocity) override {
    const Slot slot = *balls_.find(id);
    Body<Real>& body = balls_.bodies[slot];
    body.x = position.cast<Real>();
    body.v = velocity.cast<Real>();
    body.time = now_;
    balls_.bringHome(slot);
    balls_.lift(slot);
    balls_.velocityChanged(slot);
    changedFromOutside();
  }

  void setVelocity(BallId id, const Vector3& velocity) override {
    const Slot slot = *balls_.find(id);
    balls_.settle(slot, now_);
    balls_.bodies[slot].v = velocity.cast<Real>();
    balls_.velocityChanged(slot);
    changedFromOutside();
  }

  bool advanceTo(Time target, std::uint64_t max_events) override {
    if (era_is_stale_) beginEra();
    while (true) {
      const Real limit = Real(target - origin_);
      if (!frame_.isOpen()) openFrame(limit);
      if (!takeImpacts(std::min(limit, frame_.end()), max_events)) {
        reached_ = origin_ + double(now_);
        return false;
      }
      if (frame_.isOpen() && limit <= frame_.end()) {
        now_ = limit;
        reached_ = target;
        return true;
      }
      if (frame_.isOpen()) now_ = frame_.end();  // else it was cut short, at the time of an impact
      frame_.close();
      if (now_ >= era_) turnEra();
    }
  }
  using Method::advanceTo;

  Time now() const override { return reached_; }

  void read(BallStates& states) const override {
    const std::vector<Slot>& slots = balls_.slots;
    states.time = now();
    states.ids.resize(slots.size());
    states.positions.resize(slots.size());
    states.velocities.resize(slots.size());
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const Body<Real> body = bodyNow(slots[i]);
      states.ids[i] = balls_.cards[slots[i]].id;
      states.positions[i] = body.x.template cast<double>();
      states.velocities[i] = body.v.template cast<double>();
    }
  }

  Ball ball(BallId id) const override {
    const Slot slot = *balls_.find(id);
    const Body<Real> body = bodyNow(slot);
    return {body.x.template cast<double>(), body.v.template cast<double>(), double(body.radius),
            balls_.cards[slot].mass};
  }

  std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                    std::optional<BallId> ignore) const override {
    std::optional<BallId> found;
    for (Slot slot = 0; slot < balls_.size(); ++slot) {
      const BallId id = balls_.cards[slot].id;
      if (id == ignore || (found && *found < id)) continue;
      const Vec dx = balls_.box.nearestImage(balls_.positionAt(slot, now_) - position.cast<Real>());
      const Real reach = (balls_.bodies[slot].radius + Real(radius)) * (1 - Real(1e-12));
      if (dot(dx, dx) < reach * reach) found = id;
    }
    return found;
  }

  Statistics statistics() const override {
    Statistics statistics = statistics_;
    statistics.virial = virial_.value();
    statistics.queue_depth = pending_.size();
    statistics.bytes = balls_.bytes() + frame_.bytes() + search_.bytes() + plans_.bytes() +
                       report_.bytes() + capacityBytes(pending_) + capacityBytes(slice_) +
                       capacityBytes(waiting_.impacts());
    return statistics;
  }

  void setCollisionLog(CollisionLog* log) override { log_ = log; }

 private:
  static constexpr std::size_t kFewBalls = 2000;  // not worth waking threads for
  // Fewer are in the caches, so that planning costs 2 to 7 % and gains nothing.
  static constexpr std::size_t kFewBallsToPlan = 5000;
  static constexpr int kErasToSettle = 16;
  static constexpr int kFramesPerGivingBack = 16;
  // Longer slices: more impacts share balls. Shorter: less is near in memory. A flat optimum.
  static constexpr double kImpactsPerBallAndSlice = 0.015;

  Body<Real> bodyNow(Slot slot) const {
    Body<Real> body = balls_.bodyAt(slot, now_);
    body.x = balls_.box.wrapped(body.x);
    return body;
  }

  // --- eras

  void changedFromOutside() {
    frame_.close();
    era_is_stale_ = true;
  }

  void beginEra() {
    setBack(now_);
    origin_ = reached_;
    for (Slot slot = 0; slot < balls_.size(); ++slot) {  // those changed, and few others
      if (balls_.bodies[slot].time == 0) balls_.findWallVisit(slot);
    }
    era_ = eraLength(balls_);
    era_is_stale_ = false;
    frame_.forgetLayout();
    balls_.giveBackRoom();
  }

  void turnEra() {
    setBack(era_);
    origin_ = origin_ + double(era_);
    // A place stored long ago would lose digits of its time.
    for (Slot slot = 0; slot < balls_.size(); ++slot) {
      if (balls_.bodies[slot].time < -kErasToSettle * era_) balls_.settle(slot, now_);
    }
    era_ = eraLength(balls_);
  }

  // All clocks start again, now.
  void setBack(Real by) {
    now_ = 0;
    if (by == 0) return;
    watch_.setBack(by);
    balls_.setBack(by);
  }

  // --- frames and slices

  // Finds all that happens from now to the end of a new frame.
  void openFrame(Real limit) {
    WorkerPool& pool = pools_.forWork(balls_.size(), kFewBalls);
    const std::uint64_t searches = 2 * statistics_.ball_collisions + statistics_.wall_collisions;
    frame_.open({now_, limit, era_, origin_, searches}, pool);
    pending_.clear();
    if (++frames_since_giving_back_ >= kFramesPerGivingBack) giveBackRoom();
    search_.findAll(pool, pending_);
    impacts_in_frame_ = pending_.size();
    most_pending_ = impacts_in_frame_ + impacts_in_frame_ / 2;
  }

  void giveBackRoom() {
    frames_since_giving_back_ = 0;
    pending_.giveBackRoom();
    slice_.giveBackRoom();
    waiting_.giveBackRoom();
    search_.giveBackRoom();
    plans_.giveBackRoom();
    report_.giveBackRoom();
  }

  // Takes all impacts up to a time, and those that follow from them.
  // @return false when `max_events` was not enough
  bool takeImpacts(Real until, std::uint64_t& max_events) {
    while (frame_.isOpen()) {
      slice_end_ = sliceEnd(until, max_events);
      gather();
      if (isWorthPlanning(max_events)) {
        plans_.make(slice_, now_, slice_end_, waiting_, pending_);
      } else {
        for (const Impact<Real>& impact : slice_) waiting_.push(impact);
      }
      if (!takeInOrder(max_events)) {
        if (max_events == 0) return false;
        continue;
      }
      if (frame_.isOpen()) now_ = slice_end_;
      if (slice_end_ >= until) return true;
    }
    return true;
  }

  bool isWorthPlanning(std::uint64_t max_events) const {
    return balls_.size() >= kFewBallsToPlan && frame_.oneImageIsNear() &&
           slice_.size() >= plans_.kFewImpacts && slice_.size() <= max_events;
  }

  // A slice of the frame so long that few of its impacts have to do with each other.
  Real sliceEnd(Real until, std::uint64_t max_events) const {
    const auto most = std::min(kImpactsPerBallAndSlice * static_cast<double>(balls_.size()),
                               static_cast<double>(max_events / 2));
    const Real share =
        Real(std::max(most, double(plans_.kFewImpacts)) / double(impacts_in_frame_ + 1));
    const Real slices = std::ceil((until - now_) / (share * (frame_.end() - frame_.start())));
    const Real end = slices > 1 ? now_ + (until - now_) / slices : until;
    return end > now_ ? std::min(end, until) : until;
  }

  // Takes the impacts of the slice out of the pending ones; they stay in the order of the grid.
  void gather() {
    slice_.clear();
    const bool drops_stale = pending_.size() > most_pending_;
    std::size_t kept = 0;
    for (const Impact<Real>& impact : pending_) {
      if (impact.time > slice_end_) {
        if (!drops_stale || !isStale(impact, balls_)) pending_[kept++] = impact;
      } else if (!isStale(impact, balls_)) {
        slice_.push_back(impact);
      }
    }
    pending_.resize(kept);
    if (drops_stale) most_pending_ = std::max(most_pending_, kept + kept / 2);
  }

  // Takes what waits for its turn, the earliest first, and what follows up to the end of the slice;
  // then what is planned.
  // @return false when `max_events` was not enough
  bool takeInOrder(std::uint64_t& max_events) {
    const Buffer<Impact<Real>>& waiting = waiting_.impacts();
    while (!waiting.empty()) {
      const Impact<Real> impact = waiting.front();
      if (!isStale(impact, balls_) && max_events <= plans_.left()) {
        settlePlans(&impact, max_events);
        pending_.append(waiting);
        waiting_.clear();
        return false;
      }
      waiting_.pop();
      if (isStale(impact, balls_)) continue;
      --max_events;
      ++statistics_.events;
      now_ = std::max(now_, impact.time);
      fetchSoonest();
      impact.b < kWall ? takeBalls(impact) : takeWall(impact);
      if (!frame_.isOpen()) {
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
    const Buffer<Impact<Real>>& waiting = waiting_.impacts();
    for (std::size_t i = 0; i < std::min(waiting.size(), std::size_t{3}); ++i) {
      frame_.fetchBall(waiting[i].a);
      if (waiting[i].b < kWall) frame_.fetchBall(waiting[i].b);
    }
  }

  // Lets the plans come true that are left: all, or those before `bound`; then the others are
  // pending again.
  void settlePlans(const Impact<Real>* bound, std::uint64_t& max_events) {
    plans_.settle(bound, waiting_);
    plans_.forEachThatCameTrue([this](const Outcome<Real>& outcome) {
      count(outcome);
      now_ = std::max(now_, outcome.impact.time);
      if (log_ != nullptr && outcome.happens()) report_.addPlanned(outcome);
    });
    statistics_.events += plans_.left();
    max_events -= plans_.left();
    if (log_ != nullptr) report_.giveTo(*log_, origin_);
    plans_.clear();
  }

  // --- impacts in turn

  void takeBalls(const Impact<Real>& found) {
    Outcome<Real> outcome;
    foresee(found, balls_, outcome);
    if (outcome.happens()) {
      watchBalls(outcome);
      if (log_ != nullptr) {
        report_.addInTurn(outcome.impact, collisionOf(outcome, balls_, origin_));
      }
    }
    count(outcome);
    for (std::size_t side = 0; side < 2; ++side) {
      const Slot slot = outcome.slot(side);
      const Side<Real>& after = outcome.sides[side];
      balls_.bodies[slot] = after.body;
      balls_.cards[slot] = after.card;
      balls_.velocityChanged(slot, after.card.met);
    }
    const Rest a = goOn(outcome.impact.a);
    const Rest b = goOn(outcome.impact.b);
    if (!frame_.isOpen()) return;
    Searcher<Real>& searcher = search_.searcher(0);
    search_.considerWall(a.slot, searcher);
    search_.considerWall(b.slot, searcher);
    search_.lookAround(a, b, searcher);
    findWhatFollows(outcome.impact);
  }

  void takeWall(const Impact<Real>& impact) {
    const Slot slot = impact.a;
    const std::uint32_t index = impact.b - kWall;
    const Wall<Real>& wall = balls_.walls[index];
    Body<Real>& body = balls_.bodies[slot];
    body = balls_.bodyAt(slot, impact.time);
    const Real pull = dot(balls_.acceleration(slot), wall.normal);
    const WallImpact<Real> passed =
        meetWall<Real>(wall, body.x, body.radius, pull, balls_.restitution, body.time,
                       {body.v, balls_.inverseMass(slot), balls_.cards[slot].history});
    noteOverlap(passed.overlap);
    if constexpr (kGravity) {
      if (passed.rests) balls_.resting[slot].add(static_cast<int>(index));
    }
    if (passed.speed > 0) {
      ++statistics_.wall_collisions;
      const Real change = (1 + passed.restitution) * passed.speed;
      watchWall(impact, change, passed.speed);
      if (log_ != nullptr) {
        report_.addInTurn(impact,
                          collisionWithWall(impact, body, change, passed.speed, balls_, origin_));
      }
    }
    balls_.velocityChanged(slot);
    const Rest rest = goOn(slot);
    if (!frame_.isOpen()) return;
    search_.considerWall(slot, search_.searcher(0));
    search_.lookAround(rest, search_.searcher(0));
    findWhatFollows(impact);
  }

  // Takes a ball's new path into the frame, or ends the frame if it leads too far.
  // @return the path in the grid
  Rest goOn(Slot slot) {
    balls_.bringHome(slot);
    balls_.findWallVisit(slot);
    return {slot, frame_.change(slot)};
  }

  // Finds all impacts with those who have been looked for, to the end of the frame.
  // @param now  the impact that they were looked for after
  void findWhatFollows(const Impact<Real>& now) {
    Searcher<Real>& searcher = search_.searcher(0);
    search_.identify(searcher, [this](Slot other) { plans_.fetch(other); });
    plans_.consider(now, searcher, waiting_);
    search_.considerPairs(searcher);
    for (const Impact<Real>& impact : searcher.found) {
      if (impact.time > slice_end_) {
        pending_.push_back(impact);
      } else {
        waiting_.push(impact);
      }
    }
    searcher.found.clear();
  }

  // --- bookkeeping

  void count(const Outcome<Real>& outcome) {
    if (!outcome.happens()) return;
    ++statistics_.ball_collisions;
    virial_.add(double(outcome.passed.exchange.impulse * outcome.reach()));
    noteOverlap(outcome.passed.overlap);
  }

  void noteOverlap(Real overlap) {
    statistics_.deepest_overlap = std::max(statistics_.deepest_overlap, double(overlap));
  }

  void watchBalls(const Outcome<Real>& outcome) {
    const auto& [impact, sides, passed] = outcome;
    const Exchange<Real>& exchange = passed.exchange;
    watch(impact.time,
          {sides[0].card.id, sides[0].body.v, balls_.inverseMass(impact.a), exchange.change1},
          {sides[1].card.id, sides[1].body.v, balls_.inverseMass(impact.b), exchange.change2},
          passed.normal, exchange.approach_speed, outcome.reach());
  }

  void watchWall(const Impact<Real>& impact, Real change, Real speed) {
    const Body<Real>& body = balls_.bodies[impact.a];
    const std::uint32_t index = impact.b - kWall;
    const Vec at_rest = Vec::Zero();
    watch(body.time, {balls_.cards[impact.a].id, body.v, balls_.inverseMass(impact.a), change},
          {OrderWatch<Real>::wallKey(index), at_rest, 0, 0}, -balls_.walls[index].normal, speed,
          body.radius);
  }

  void watch(Real time, const typename OrderWatch<Real>::Side& a,
             const typename OrderWatch<Real>::Side& b, const Vec& normal, Real speed, Real reach) {
    if (watch_.note(time, a, b, normal, speed, reach, balls_.restitution)) {
      ++statistics_.ambiguous_impacts;
    }
  }

  WorkerPools pools_;
  Balls<Real, kGravity> balls_;
  Frame<Real, kGravity> frame_;
  ImpactSearch<Real, kGravity> search_;
  Buffer<Impact<Real>> pending_;      // of the frame: found, and not looked at since
  std::size_t impacts_in_frame_ = 0;  // found at its start
  std::size_t most_pending_ = 0;      // before stale ones are looked for
  int frames_since_giving_back_ = 0;

  // The slice.
  Real slice_end_ = 0;          // s, in this era
  Buffer<Impact<Real>> slice_;  // its impacts
  Plans<Real, kGravity> plans_;
  ImpactHeap<Real, kGravity> waiting_;  // those taken in turn
  CollisionReport<Real, kGravity> report_;

  Time origin_;   // when this era began
  Real era_ = 0;  // s, its length
  bool era_is_stale_ = true;
  Real now_ = 0;  // s, in this era
  Time reached_;  // what now() tells
  OrderWatch<Real> watch_;
  Statistics statistics_;
  ExactSum virial_;  // J; as slices end anywhere, its terms come in any order
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core::continuous
