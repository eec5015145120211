// Method soft_sphere: balls that push each other apart by linear springs while they overlap.
//
// Steps by velocity Verlet (Swope, Andersen, Berens, Wilson 1982): order 2 between contacts' ends.
// Dashpots need the velocity at the end of the step and get it predicted with the acceleration
// before. All contacts last equally long, t_c: spring and dashpot go with the reduced mass
// (contact_spring.hpp). t_c is 50 time steps, or what the scene's tolerance asks for.
//
// Gets right: contacts that last a finite time, and those of many balls at once; piles rest on
// their springs. Momentum to rounding. Misses: the hard ball. An impact at speed u overlaps by
// u t_c / pi and passes t_c late; forces jump where contacts begin and end, so that a step of dt
// changes the energy of an impact by about 2 (dt/t_c)^3 of it (1.7e-2, 2e-3, 2.5e-4 and 1.6e-5 at
// t_c/5, /10, /20 and /50). While balls touch, part of the energy is in their springs
// (Statistics::elastic_energy). A restitution below 0.01 is taken as 0.01.
// Limits: unstable beyond dt = 2 t_c / pi = 0.637 t_c; steps above t_c/10 are refused; a scene that
// names none gets one that fits (fitting_step.hpp). Overlaps beyond the tolerance (without one: a
// tenth of a radius), and ways of more than half a radius in a step, make warning() speak. See also
// near_pairs.hpp.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/methods.hpp"
#include "soft_sphere/contact_spring.hpp"
#include "stepping/stepped_method.hpp"

namespace ball_sim::core {

constexpr double kUsualStepsPerContact = 50;  ///< where the scene asks for no contact time
constexpr double kUsualOverlap = 0.1;         ///< of a radius, where it asks for no tolerance

class SoftSphere final : public SteppedMethod {
 public:
  /// @param time_step     s, > 0
  /// @param contact_time  s, > 0; any, so that a test may show what a step too long does
  /// @param tolerance     overlap, of a radius, beyond which warning() speaks
  SoftSphere(const Surroundings& surroundings, double time_step, double contact_time,
             double tolerance);

  const char* name() const override { return "soft_sphere"; }
  Statistics statistics() const override;
  std::string warning() const override;

 private:
  /// Two partners that overlap.
  struct Contact {
    Vector3 normal = Vector3::Zero();  // unit, from a to its partner
    double overlap = 0;                // m, > 0
    double distance = 0;               // m, of centres; at a wall of the centre from it
  };

  void step() override;

  void move();
  void pullAll();
  bool findContact(const NearPair& pair, Contact& contact) const;
  void pull(NearPair& pair, const Contact& contact);
  void noteBegin(NearPair& pair, double approach_speed);
  void noteEnd(NearPair& pair);
  double inverseMass(const NearPair& pair) const;
  double approachSpeed(const NearPair& pair, const Vector3& normal) const;

  ContactSpring spring_;
  double contact_time_;                 // s
  double tolerance_;                    // of a radius
  double deepest_ = 0;                  // overlap, of the smaller radius
  std::vector<Vector3> accelerations_;  // m/s^2, of the end of the step, one a slot
};

/// @param settings  time step, contact time, tolerance; the arithmetic is double whatever is asked:
///                  the method's own errors are far above rounding
/// @throws std::invalid_argument  a time step above a tenth of the contact time
std::unique_ptr<Method> makeSoftSphere(const Surroundings& surroundings,
                                       const MethodSettings& settings);

}  // namespace ball_sim::core
