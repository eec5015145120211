// Method discrete: the plain algorithm. Move every ball by one time step, then let those that
// overlap and approach exchange momentum along their line of centres.
//
// A step moves along the exact parabola (half the way with the velocity before, half with that
// after, order 2, without error in uniform gravity), finds the overlaps, and applies the collision
// law to pairs that approach, again and again until none does. Below a restitution of 1 and under
// gravity, contacts slower than the resting speed, 2 g dt, rest: what holds them up is a set of
// impulses, none of them below 0, found by projected Gauss-Seidel from those of the step before
// (Moreau, "Numerical aspects of the sweeping process", 1999; Catto, "Iterative dynamics with
// temporal coherence", 2005). They act during the step as constant forces, so that a ball at rest
// stays where it is. What resting contacts overlap by more than a thousandth of the radius is taken
// away by moving the balls, never by a velocity. Balls that lie still (rest_watch.hpp) on others
// that do fall asleep: they cost nothing and stand like walls until they are hit, touched, or borne
// by or bearing another load, or what they touch is changed from outside.
//
// Gets right: momentum, and at e = 1 energy, to rounding: nothing is moved or sped up but by the
// collision law. Piles rest: they neither sink nor creep. Misses: an impact is seen up to a step
// late, so places are wrong by the order of dt, and pairs that pass each other within a step are
// missed, a share (v dt)^2 / (3 R^2) of impacts at speed v and sum of radii R, for v dt < R: a
// quarter of them were never seen to overlap, the others only when they parted again. Bounces of
// fewer than four steps are not seen: they rest.
// Limits: a ball that moves by more than half its radius in a step makes warning() speak. So does a
// pile that a step is too long for: of 300 balls poured into a box nearly all sleep by 8 to 12 s at
// steps up to 0.042 sqrt(r/g), r the radius, by 12 to 16 s at 0.056, and at 0.11 not by 16 s. See
// also near_pairs.hpp.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ball_sim/methods.hpp"
#include "discrete/rest_watch.hpp"
#include "stepping/stepped_method.hpp"

namespace ball_sim::core {

constexpr double kGoodRestingStep = 0.03;  ///< of sqrt(r/g); piles rest as soon as at shorter ones
constexpr double kLongestRestingStep = 0.05;  ///< of sqrt(r/g); beyond it they rest late

class Discrete final : public SteppedMethod {
 public:
  /// @param time_step  s, finite, > 0
  Discrete(const Surroundings& surroundings, double time_step);

  const char* name() const override { return "discrete"; }
  Statistics statistics() const override;
  std::string warning() const override;

 private:
  struct Contact {
    std::uint32_t pair = 0;            // index into pairs()
    Slot a = 0;                        // a ball that moves
    std::uint32_t b = 0;               // its partner, as in NearPair
    bool resting = false;              // slow enough
    Vector3 normal = Vector3::Zero();  // unit, from a to b
    double gap = 0;                    // m; below 0: overlap
    double w_a = 0;                    // 1/kg
    double w_b = 0;                    // 1/kg; 0: a wall or a ball that stands still
    double load = 0;                   // N s, what the contact bears in a step
  };

  void step() override;
  void ballsChanged() override;
  void moversChanged() override;

  void fall();
  void fallAndRest();
  double pressApart(Contact& contact, double wanted);
  void findContacts();
  bool findContact(const NearPair& pair, Contact& contact) const;
  void resolveImpacts();
  bool resolveImpact(Contact& contact);
  void markResting();
  void separate();
  void wakeWhereLoadsChanged();
  void wakeIfUnloaded(const NearPair& pair);
  void wake(Slot slot);
  void fallAsleep();
  void noteLateRest();
  void keepAwakeOnMovingSupports();
  double mobility(std::uint32_t partner) const;
  bool standsAsleep(std::uint32_t partner) const;
  double separationSpeed(const Contact& contact) const;
  void push(const Contact& contact, double impulse);

  Vector3 gravity_;
  double restitution_;
  double resting_speed_;     // m/s; 0: nothing rests
  double rests_late_below_;  // m, radius
  double smallest_late_;     // m, radius of balls that lie on others and rest late; +infinity: none
  std::vector<Contact> contacts_;
  RestWatch watch_;
  std::vector<std::uint8_t> drowsy_;  // one a slot: lies still, scratch of fallAsleep()
  std::uint32_t steps_since_look_ = 0;
};

/// @param settings  the time step; the arithmetic is double whatever is asked: the method's own
///                  errors are far above rounding
std::unique_ptr<Method> makeDiscrete(const Surroundings& surroundings,
                                     const MethodSettings& settings);

}  // namespace ball_sim::core
