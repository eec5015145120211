// Impacts of a slice of time that are computed side by side, by all threads in the order of the
// grid, instead of one after the other in order of time.
//
// The impacts of a short slice hardly have to do with each other. Those whose balls have no other
// one in it, nor may have one at the same instant in the next, are planned: what each leads to is
// computed without changing anything. A plan holds unless a path that it leads to meets another
// within the slice, be it one of now or one that is planned too. A plan that does not hold is
// dropped: its impact waits for its turn, with those that share balls. What happens there may end
// more plans: they are dropped, too, or come true where they are the earlier ones. At the end of
// the slice, or where it is interrupted, the plans that are left come true. So plans change no bit:
// until then they have changed nothing.
//
// While there are plans, the grid shows both paths of their balls.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "continuous/balls.hpp"
#include "continuous/buffer.hpp"
#include "continuous/frame.hpp"
#include "continuous/impact_search.hpp"
#include "continuous/impacts.hpp"
#include "continuous/worker_pool.hpp"

namespace ball_sim::core::continuous {

template <class Real, bool kGravity>
class Plans {
  using Heap = ImpactHeap<Real, kGravity>;

 public:
  static constexpr std::size_t kFewImpacts = 8;  ///< of a slice, not worth planning

  /// @param balls, frame, search, pools  outlive the plans
  Plans(Balls<Real, kGravity>& balls, Frame<Real, kGravity>& frame,
        ImpactSearch<Real, kGravity>& search, WorkerPools& pools)
      : balls_(balls),
        frame_(frame),
        search_(search),
        pools_(pools),
        before_(balls),
        disturbed_(pools.all.size()) {}

  /// Plans that have not been dropped.
  std::size_t left() const { return left_; }

  /// Plans what can be planned of a slice.
  /// @param slice      all its impacts, none stale
  /// @param slice_begin, slice_end  s, in this era
  /// @param waiting    empty; takes those that are not planned
  /// @param later      takes what plans lead to between slice and end of frame
  void make(const Buffer<Impact<Real>>& slice, Real slice_begin, Real slice_end, Heap& waiting,
            Buffer<Impact<Real>>& later) {
    slice_end_ = slice_end;
    const Real instant = Real(kInstant) * (frame_.end() - frame_.start());
    earliest_ = slice_begin + instant;
    latest_ = slice_end - instant;
    chooseLone(slice, waiting);
    left_ = lone_.size();
    plans_.resize(left_);
    first_version_ = balls_.takeVersions(left_);
    share(threads(), plans_.size(), [this](std::size_t begin, std::size_t end, unsigned) {
      inBatches(begin, end, [this](std::size_t first, std::size_t last) { draw(first, last); });
    });
    share(threads(), plans_.size(), [this](std::size_t begin, std::size_t end, unsigned thread) {
      inBatches(begin, end, [this, thread](std::size_t first, std::size_t last) {
        check(first, last, search_.searcher(thread), disturbed_[thread].plans);
      });
    });
    search_.collect(later);
    for (Disturbed& disturbed : disturbed_) {
      for (const std::uint32_t plan : disturbed.plans) drop(plan, waiting);
      disturbed.plans.clear();
    }
  }

  /// Fetches from memory whether a ball has a plan.
  void fetch(Slot slot) const {
    if (left_ > 0) touch(&plan_of_[slot]);
  }

  /// Ends the plans that new paths meet within the slice, and finds their impacts with those that
  /// are left.
  /// @param now       the impact that led to the paths: plans that are earlier come true, the
  /// others
  ///                  are dropped
  /// @param searcher  has the pairs of the paths, and takes the impacts
  void consider(const Impact<Real>& now, Searcher<Real>& searcher, Heap& waiting) {
    if (left_ == 0) return;
    for (const Pair& pair : searcher.pairs) {
      if (isPlanned(pair.other) && isMet(pair)) finish(plan_of_[pair.other], now, waiting);
    }
    for (const Pair& pair : searcher.pairs) {
      if (!isPlanned(pair.other)) continue;
      const Impact<Real> impact =
          search_.meeting(balls_.pathOf(pair.slot), pathOf(pair.other), pair.turns);
      if (impact.time <= frame_.end()) searcher.found.push_back(impact);
    }
  }

  /// Lets the plans come true that are left.
  /// @param bound  nullptr, or only those before this impact: the others are dropped
  void settle(const Impact<Real>* bound, Heap& waiting) {
    if (bound != nullptr && left_ > 0) {
      for (std::uint32_t i = 0; i < plans_.size(); ++i) {
        const Plan& plan = plans_[i];
        if (plan.state == State::open && !before_(plan.outcome.impact, *bound)) drop(i, waiting);
      }
    }
    share(threads(), plans_.size(), [this](std::size_t begin, std::size_t end, unsigned) {
      for (std::size_t i = begin; i < end; ++i) {
        if (plans_[i].state == State::open) comeTrue(plans_[i]);
      }
    });
  }

  /// Calls f with the outcome of each plan that has come true, in the order of the grid.
  template <class Function>
  void forEachThatCameTrue(const Function& f) const {
    for (const Plan& plan : plans_) {
      if (plan.state == State::came_true) f(plan.outcome);
    }
  }

  /// Forgets plans that have been settled.
  void clear() {
    plans_.clear();
    left_ = 0;
  }

  void giveBackRoom() {
    plans_.giveBackRoom();
    lone_.giveBackRoom();
    for (Disturbed& disturbed : disturbed_) disturbed.plans.giveBackRoom();
  }

  std::size_t bytes() const {
    std::size_t bytes = capacityBytes(lone_) + capacityBytes(plans_) + capacityBytes(plan_of_);
    for (const Disturbed& disturbed : disturbed_) bytes += capacityBytes(disturbed.plans);
    return bytes;
  }

 private:
  enum class State { open, leads_too_far, dropped, came_true };

  struct Plan {
    Outcome<Real> outcome;
    std::array<WallVisit<Real>, 2> wall_visits;  // of both balls, afterwards
    State state = State::open;

    Path<Real> path(std::size_t side) const {
      return {outcome.slot(side), &outcome.sides[side].body, &outcome.sides[side].card};
    }
  };

  // Plans that a thread has found not to hold.
  struct alignas(64) Disturbed {
    Buffer<std::uint32_t> plans;
  };

  static constexpr std::size_t kFewPlans = 200;  // not worth waking threads for
  // Of a frame, in which the fastest ball moves by a thirtieth of a radius or more. Impacts so near
  // to a slice's end are taken in turn, where OrderWatch sees them: one that shares a ball with
  // them at the same instant may be in the next slice. Wide enough for speeds of approach down to
  // 1e-5 of the fastest ball's, and one impact in a thousand.
  static constexpr double kInstant = 0x1p-16;
  // Instead of a plan's index.
  static constexpr std::uint32_t kNoPlan = 0xFFFFFFFF;
  static constexpr std::uint32_t kOneImpact = 0xFFFFFFFE;
  static constexpr std::uint32_t kManyImpacts = 0xFFFFFFFD;

  WorkerPool& threads() { return pools_.forWork(plans_.size(), kFewPlans); }

  bool isPlanned(Slot slot) const { return plan_of_[slot] != kNoPlan; }

  // The way of a ball that is planned.
  Path<Real> pathOf(Slot slot) const {
    const Plan& plan = plans_[plan_of_[slot]];
    return plan.path(slot == plan.outcome.impact.a ? 0 : 1);
  }

  // --- choice

  // Sorts out the impacts of the slice that share no ball; the others wait for their turn.
  void chooseLone(const Buffer<Impact<Real>>& slice, Heap& waiting) {
    plan_of_.resize(balls_.size(), kNoPlan);
    lone_.clear();
    for (const Impact<Real>& impact : slice) {
      forBalls(impact, [this](Slot slot) {
        plan_of_[slot] = plan_of_[slot] == kNoPlan ? kOneImpact : kManyImpacts;
      });
    }
    for (const Impact<Real>& impact : slice) {
      if (isLone(impact)) {
        lone_.push_back(impact);
      } else {
        waiting.push(impact);
      }
    }
    for (const Impact<Real>& impact : waiting.impacts()) {
      forBalls(impact, [this](Slot slot) { plan_of_[slot] = kNoPlan; });
    }
    for (std::size_t i = 0; i < lone_.size(); ++i) {
      plan_of_[lone_[i].a] = plan_of_[lone_[i].b] = static_cast<std::uint32_t>(i);
    }
  }

  template <class Function>
  static void forBalls(const Impact<Real>& impact, const Function& f) {
    f(impact.a);
    if (impact.b < kWall) f(impact.b);
  }

  // Impacts with walls, and of balls that rest on walls, are taken in turn.
  bool isLone(const Impact<Real>& impact) const {
    return impact.b < kWall && !balls_.isResting(impact.a) && !balls_.isResting(impact.b) &&
           plan_of_[impact.a] == kOneImpact && plan_of_[impact.b] == kOneImpact &&
           impact.time > earliest_ && impact.time < latest_;
  }

  // --- planning, by all threads

  // Computes some plans, and lets the grid show both paths of their balls.
  void draw(std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      frame_.fetchBall(lone_[i].a);
      frame_.fetchBall(lone_[i].b);
    }
    for (std::size_t i = begin; i < end; ++i) {
      frame_.fetchPath(lone_[i].a);
      frame_.fetchPath(lone_[i].b);
    }
    for (std::size_t i = begin; i < end; ++i) draw(i);
  }

  void draw(std::size_t i) {
    Plan& plan = plans_[i];
    foresee(lone_[i], balls_, plan.outcome);
    plan.state = State::open;
    for (std::size_t side = 0; side < 2; ++side) {
      Side<Real>& after = plan.outcome.sides[side];
      after.card.version = first_version_ + static_cast<std::uint32_t>(i);
      const Path<Real> path = plan.path(side);
      if (!balls_.walls.empty()) {
        plan.wall_visits[side] = balls_.wallVisit(path.slot, after.body);
      }
      if (!frame_.add(path)) plan.state = State::leads_too_far;
    }
  }

  // Finds which plans do not hold, and what some plans lead to after the slice.
  void check(std::size_t begin, std::size_t end, Searcher<Real>& searcher,
             Buffer<std::uint32_t>& disturbed) const {
    const auto note = [&](const Impact<Real>& impact) {
      if (impact.time <= slice_end_) {
        forBalls(impact, [&](Slot slot) {
          if (isPlanned(slot)) disturbed.push_back(plan_of_[slot]);
        });
      } else if (impact.time <= frame_.end()) {
        searcher.found.push_back(impact);
      }
    };
    for (std::size_t i = begin; i < end; ++i) {
      const Plan& plan = plans_[i];
      if (plan.state != State::open) disturbed.push_back(static_cast<std::uint32_t>(i));
      if (!balls_.walls.empty()) {
        for (std::size_t side = 0; side < 2; ++side) {
          note(search_.wallImpact(plan.path(side), plan.wall_visits[side]));
        }
      }
      search_.lookAround(restOf(plan.path(0)), restOf(plan.path(1)), searcher);
    }
    search_.identify(searcher, [this](Slot slot) { fetch(slot); });
    for (const Pair& pair : searcher.pairs) considerPair(pair, note);
    searcher.pairs.clear();
  }

  Rest restOf(const Path<Real>& path) const { return {path.slot, frame_.inGrid(path)}; }

  // What a planned path meets: the other as it is now, and as it is planned, each two once.
  template <class Note>
  void considerPair(const Pair& pair, const Note& note) const {
    const Path<Real> path = pathOf(pair.slot);
    const Outcome<Real>& outcome = plans_[plan_of_[pair.slot]].outcome;
    if (pair.other != outcome.partnerOf(pair.slot)) {
      note(search_.meeting(path, balls_.pathOf(pair.other), pair.turns));
    }
    if (isPlanned(pair.other) && pair.slot < pair.other) {
      note(search_.meeting(path, pathOf(pair.other), pair.turns));
    }
  }

  // --- what becomes of plans

  // Whether a ball meets one that is planned within the slice, be it as it is now or as planned.
  bool isMet(const Pair& pair) const {
    const Path<Real> path = balls_.pathOf(pair.slot);
    return search_.meeting(path, pathOf(pair.other), pair.turns).time <= slice_end_ ||
           search_.meeting(path, balls_.pathOf(pair.other), pair.turns).time <= slice_end_;
  }

  // Ends a plan at an impact of now.
  void finish(std::uint32_t index, const Impact<Real>& now, Heap& waiting) {
    if (before_(plans_[index].outcome.impact, now)) {
      comeTrue(plans_[index]);
    } else {
      drop(index, waiting);
    }
  }

  // Puts the impact of a plan among those that wait for their turn, if it is not there yet.
  void drop(std::uint32_t index, Heap& waiting) {
    Plan& plan = plans_[index];
    if (plan.state == State::dropped) return;
    plan.state = State::dropped;
    for (std::size_t side = 0; side < 2; ++side) plan_of_[plan.outcome.slot(side)] = kNoPlan;
    --left_;
    waiting.push(plan.outcome.impact);
  }

  void comeTrue(Plan& plan) {
    plan.state = State::came_true;
    for (std::size_t side = 0; side < 2; ++side) {
      const Slot slot = plan.outcome.slot(side);
      balls_.bodies[slot] = plan.outcome.sides[side].body;
      balls_.cards[slot] = plan.outcome.sides[side].card;
      if (!balls_.walls.empty()) balls_.wall_visits[slot] = plan.wall_visits[side];
      plan_of_[slot] = kNoPlan;
    }
  }

  Balls<Real, kGravity>& balls_;
  Frame<Real, kGravity>& frame_;
  ImpactSearch<Real, kGravity>& search_;
  WorkerPools& pools_;
  ImpactOrder<Real, kGravity> before_;

  Real slice_end_ = 0;                  // s, in this era
  Real earliest_ = 0, latest_ = 0;      // s, in this era: what is planned lies between
  Buffer<Impact<Real>> lone_;           // those planned
  Buffer<Plan> plans_;                  // of this slice
  std::size_t left_ = 0;                // of these, not dropped
  std::uint32_t first_version_ = 0;     // of the first plan's balls, once it comes true; then on
  std::vector<std::uint32_t> plan_of_;  // by slot
  std::vector<Disturbed> disturbed_;    // by thread
};

}  // namespace ball_sim::core::continuous
