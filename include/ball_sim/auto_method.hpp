// Method auto at work: runs the method chosen, watches how it does, and changes over when another
// one would do better or this one can not go on.
//
// Watched every few events a ball, whoever calls and however often: so that the same scene changes
// over at the same event. What leads to a change:
// - A flood. Where balls lie on balls (gravity, restitution below 1), event-driven methods hum:
//   hundreds of impacts while a ball would fall by its radius, none of which moves anything. From
//   then on method discrete steps, with contacts that rest. Its step is the scene's, or shorter, so
//   that what a ball falls in a step stays within the scene's tolerance.
// - A pile from the start, as a scene may have it: every ball lies still, upon a wall or another
//   ball. There is no need to wait for its flood.
// - The pile is stirred: half of the balls move fast enough to rise by their radius, or one of them
//   moves half its radius a step, or energy has appeared. Back to the exact method.
// - Another exact method would cost much less at the rate of collisions that is counted.
// A flood that comes back soon after a pile was stirred doubles the time before the next way back,
// so that no scene makes it flutter. An exact method is left for a stepping one only for a pile,
// and never where impacts at one instant are to be taken together, which only event_driven can.
// An exact method whose balls overlap by more than the tolerance makes warning() speak, and so does
// one whose energy drifts by more than that where impacts keep it (restitution 1). Neither leads to
// a change: the other exact methods round as this one does.
//
// Gets right: what the method at work does. Misses: a change over forgets which balls have just
// met; energy that contacts of discrete held at rest in overlap comes free within its tolerance.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/method.hpp"
#include "ball_sim/method_choice.hpp"
#include "ball_sim/methods.hpp"

namespace ball_sim::core {

class AutoMethod final : public Method {
 public:
  /// @param first  an exact method, and why
  AutoMethod(const Surroundings& surroundings, const MethodSettings& settings,
             const MethodChoice& first);

  const char* name() const override { return method_->name(); }
  std::string reason() const override;
  std::string warning() const override;

  void insert(BallId id, const Ball& ball) override;
  void remove(BallId id) override;
  void setMotion(BallId id, const Vector3& position, const Vector3& velocity) override;
  void setVelocity(BallId id, const Vector3& velocity) override;
  bool advanceTo(Time target, std::uint64_t max_events) override;
  using Method::advanceTo;
  Time now() const override { return method_->now(); }
  void read(BallStates& states) const override { method_->read(states); }
  Ball ball(BallId id) const override { return method_->ball(id); }
  std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                    std::optional<BallId> ignore) const override {
    return method_->findOverlap(position, radius, ignore);
  }
  Statistics statistics() const override;
  void setCollisionLog(CollisionLog* log) override;

  /// How often the method was changed so far.
  std::uint64_t changes() const { return changes_; }

 private:
  // A look at the run: what happened since the look before, and how the balls move now.
  struct Look {
    double event_rate = 0;      // 1/s, per ball that can move; +infinity: no time has passed
    double collision_rate = 0;  // 1/s, of a ball
    double mean_speed = 0;      // m/s
    double median_speed = 0;    // m/s
    double fastest = 0;         // m/s
    double kinetic = 0;         // J
    double potential = 0;       // J, of gravity

    double energy() const { return kinetic + potential; }
  };

  std::uint64_t eventsToLook(std::uint64_t counted) const;
  void outsideChange();
  void startWindow();
  Look look();
  void survey();
  void watchEnergy(const Look& look);
  void judge(const Look& look);
  void judgeExact(const Look& look);
  void judgeStepping(const Look& look);
  std::string overlapWarning() const;
  std::string energyWarning() const;
  double energyLimit(const Look& look) const;
  bool floods(const Look& look) const;
  std::string stirring(const Look& look) const;
  void startStepping(const std::string& reason);
  bool liesStill() const;
  void considerCheaper(const Look& look);
  void changeTo(const std::string& name, const std::string& reason);
  std::unique_ptr<Method> make(const std::string& name) const;
  bool beyondHorizon() const;
  double fallTime() const;
  double steppingStep() const;

  Surroundings surroundings_;
  MethodSettings settings_;
  double gravity_ = 0;                // m/s^2, magnitude
  std::vector<std::string> choices_;  // methods there are for this scene
  bool keeps_energy_ = false;
  bool can_pile_ = false;
  std::string exact_name_;    // the exact method to go back to
  std::string exact_reason_;  // of the choice at the start
  std::string change_;        // why the last change came; empty: there was none
  std::unique_ptr<Method> method_;
  bool stepping_ = false;
  CollisionLog* log_ = nullptr;
  Statistics before_;  // of the methods before
  std::uint64_t changes_ = 0;

  struct Properties {
    BallId id;
    double radius;  // m
    double mass;    // kg
  };
  std::vector<Properties> balls_;  // ids ascending
  std::size_t movable_ = 0;
  SceneNumbers numbers_;
  bool changed_outside_ = false;  // since numbers_ were taken

  Time window_start_;
  std::uint64_t window_events_ = 0;      // counted before it
  std::uint64_t window_collisions_ = 0;  // counted before it
  int floods_ = 0;                       // windows in a row that flood
  int dearer_ = 0;                       // windows in a row in which another method is cheaper
  Time changed_at_;
  double stay_ = 0;             // s, of stepping before the way back is open
  double energy_limit_ = 0;     // J, of a pile left alone
  double energy_kept_ = 0;      // J, when numbers_ were taken
  double most_kinetic_ = 0;     // J, since then
  double energy_drift_ = 0;     // of most_kinetic_, the largest so far
  BallStates states_;           // scratch
  std::vector<double> speeds_;  // scratch
};

}  // namespace ball_sim::core
