// What all stepping methods share: balls in arrays, steps on a fixed grid of dates, and reading
// between them.
//
// A ball's state is kept at the last step. Between steps it is read by free flight under the
// acceleration that the step gave it, and reading leaves no trace: what a method has at a date does
// not depend on the dates it stopped at. A change between two steps (a ball put in, pushed, moved)
// acts from its date on, as if the ball had come to its new motion by free flight since the last
// step. While nothing moves there is no grid; it starts with the next change.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/method.hpp"
#include "stepping/near_pairs.hpp"
#include "stepping/step_clock.hpp"
#include "stepping/stepped_ball.hpp"

namespace ball_sim::core {

class SteppedMethod : public Method {
 public:
  /// @param time_step  s, finite, > 0
  SteppedMethod(const Surroundings& surroundings, double time_step);

  std::string reason() const override;

  void insert(BallId id, const Ball& ball) override;
  void remove(BallId id) override;
  void setMotion(BallId id, const Vector3& position, const Vector3& velocity) override;
  void setVelocity(BallId id, const Vector3& velocity) override;

  /// Takes the steps that are due. An event is the step of one ball; a step is never cut, so up to
  /// one more of it is handled than asked for.
  bool advanceTo(Time target, std::uint64_t max_events) override;
  using Method::advanceTo;

  Time now() const override { return now_; }
  void read(BallStates& states) const override;
  Ball ball(BallId id) const override;
  std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                    std::optional<BallId> ignore) const override;
  Statistics statistics() const override;
  void setCollisionLog(CollisionLog* log) override { log_ = log; }

 protected:
  /// Moves movers() from one date of the grid to the next.
  virtual void step() = 0;

  /// Told before the next step when balls were put in, pushed, moved or taken out; isNew() and
  /// isPushed() tell which, and contacts still are those of the last step.
  virtual void ballsChanged() {}

  /// Told before the next step when movers() are others than in the last one.
  virtual void moversChanged() {}

  bool isNew(Slot slot) const { return changes_[slot] == Change::is_new; }  ///< or gone
  bool isPushed(Slot slot) const { return changes_[slot] == Change::is_pushed; }

  const Surroundings& surroundings() const { return surroundings_; }
  double timeStep() const { return clock_.length(); }  ///< s
  Time stepDate() const { return clock_.last(); }      ///< of the step that is taken

  /// From the next step on a ball stands still, or moves again.
  void setAsleep(Slot slot, bool asleep);
  bool isAsleep(Slot slot) const { return asleep_[slot] != 0; }

  std::size_t slotCount() const { return bodies_.size(); }     ///< slots are below this
  const std::vector<Slot>& movers() const { return movers_; }  ///< ascending
  SteppedBall& body(Slot slot) { return bodies_[slot]; }
  const SteppedBall& body(Slot slot) const { return bodies_[slot]; }
  Vector3& acceleration(Slot slot) { return accelerations_[slot]; }  ///< m/s^2

  NearPairs& near() { return near_; }
  const NearPairs& near() const { return near_; }
  std::vector<NearPair>& pairs() { return near_.pairs(); }
  const std::vector<NearPair>& pairs() const { return near_.pairs(); }
  const Wall<double>& wallOf(const NearPair& pair) const {
    return near_.walls()[pair.b - kFirstWall];
  }
  static bool isWithWall(const NearPair& pair) { return pair.b >= kFirstWall; }

  /// A step begins: no speed was noted in it yet.
  void forgetSpeeds() { fastest_squared_ = 0; }

  /// Notes a speed that a ball moves at in this step, m/s.
  /// @param radius  of the ball, m
  void noteSpeed(const Vector3& velocity, double radius) {
    const double squared = dot(velocity, velocity);
    fastest_squared_ = std::max(fastest_squared_, squared);
    const double far = kFarthestMove * radius / timeStep();  // m/s
    if (squared > far * far) {
      farthest_ = std::max(farthest_, std::sqrt(squared) * timeStep() / radius);
    }
  }

  /// That a ball moved so far in a step that it may have passed others unseen; empty: none did.
  std::string warningOfFarMoves() const;

  /// Lists the near pairs anew where balls have moved too far, by the speeds noted in this step.
  void updatePairs();

  /// Pairs are listed already when they are so near, m.
  void setMargin(double margin) { margin_ = margin; }
  double margin() const { return margin_; }

  Statistics& counts() { return statistics_; }

  /// Logs an impact of this step.
  /// @param normal  unit, from a to its partner
  void report(const NearPair& pair, const Vector3& normal, double impulse, double approach_speed);

 private:
  static constexpr double kFarthestMove = 0.5;  // radii in a step; beyond it discrete misses one
                                                // impact in 200
  enum class Change : std::uint8_t { none, is_pushed, is_new };

  std::vector<Slot>::const_iterator find(BallId id) const;
  Slot takeSlot();
  double sinceStep() const { return now_ - clock_.last(); }  // s
  Vector3 positionNow(Slot slot) const;
  Vector3 velocityNow(Slot slot) const;
  void setMotionNow(Slot slot, const Vector3& position, const Vector3& velocity);
  void note(Slot slot, Change change);
  void takeUpChanges();
  void sortMovers();

  Surroundings surroundings_;
  StepClock clock_;
  Time now_;
  double margin_ = 0;           // m
  double fastest_squared_ = 0;  // m^2/s^2, in the present step
  double farthest_ = 0;         // of its radius, that a ball moved in one step; 0: not too far

  // One entry a slot; a slot is reused when its ball is removed.
  std::vector<SteppedBall> bodies_;
  std::vector<Vector3> accelerations_;  // m/s^2, of free flight since the last step
  std::vector<BallId> ids_;
  std::vector<double> masses_;        // kg
  std::vector<Change> changes_;       // since the last step
  std::vector<std::uint8_t> asleep_;  // does not move though it could

  std::vector<Slot> slots_;  // of the balls there are, by ascending id
  std::vector<Slot> free_slots_;
  std::vector<Slot> movers_;
  std::vector<Slot> still_;
  bool is_changed_ = false;  // some slot has changed since the last step
  bool is_sorted_ = true;    // movers_ and still_ are as they should be
  NearPairs near_;
  Statistics statistics_;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
