// A scene in the hands of a method, with a log: what nearly every physics test begins with.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ball_sim/methods.hpp"

namespace ball_sim::core {
namespace test {

/// The mass of a fixed ball, kg.
constexpr double kFixed = std::numeric_limits<double>::infinity();

/// Surroundings and balls; ids are the places in `balls`.
struct TestScene {
  Surroundings surroundings;
  std::vector<Ball> balls;
};

/// Steps of `time_step` seconds, for a method that has steps.
inline MethodSettings stepsOf(double time_step) {
  MethodSettings settings;
  settings.time_step = time_step;
  return settings;
}

/// A method that holds a scene's balls and logs every impact from time 0 on.
class Trial {
 public:
  Trial(const std::string& method, const TestScene& scene, const MethodSettings& settings = {})
      : log_(std::make_unique<CollisionLog>()),
        method_(makeMethod(method, scene.surroundings, settings)) {
    method_->setCollisionLog(log_.get());
    for (std::size_t i = 0; i < scene.balls.size(); ++i) {
      method_->insert(static_cast<BallId>(i), scene.balls[i]);
    }
  }

  Trial(const std::string& method, const TestScene& scene, Precision precision)
      : Trial(method, scene, settingsOf(precision)) {}

  /// Advances to a date, s. More than `most_events` is a failure: a stalled clock must not hang
  /// the tests.
  void advanceTo(double seconds, std::uint64_t most_events = 20'000'000) {
    if (!method_->advanceTo(Time::fromSeconds(seconds), most_events)) {
      ADD_FAILURE() << method_->name() << " needed more than " << most_events
                    << " events to reach t = " << seconds << " s, it is at "
                    << method_->now().seconds() << " s";
    }
  }

  Method& method() { return *method_; }
  const Method& method() const { return *method_; }
  const std::vector<Collision>& collisions() const { return log_->entries; }
  CollisionLog& log() { return *log_; }

  BallStates states() const {
    BallStates states;
    method_->read(states);
    return states;
  }
  Vector3 position(BallId id) const { return method_->ball(id).position; }
  Vector3 velocity(BallId id) const { return method_->ball(id).velocity; }

 private:
  static MethodSettings settingsOf(Precision precision) {
    MethodSettings settings;
    settings.precision = precision;
    return settings;
  }

  std::unique_ptr<CollisionLog> log_;  // outlives the method, and stays where it is
  std::unique_ptr<Method> method_;
};

/// A box without height at z = 0, so that the scene is planar; open where nothing else is said.
inline Surroundings planarSpace() {
  Surroundings surroundings;
  surroundings.box.min.z() = 0;
  surroundings.box.max.z() = 0;
  return surroundings;
}

/// A horizontal floor at z = 0 under gravity (0, 0, -g).
/// @param g m/s^2, > 0
inline Surroundings floorUnderGravity(double g, double restitution) {
  Surroundings surroundings;
  surroundings.gravity = Vector3(0, 0, -g);
  surroundings.restitution = restitution;
  surroundings.box.min.z() = 0;
  return surroundings;
}

/// Sum of m v^2 / 2, J, over balls that are not fixed, in long double: an oracle of its own.
inline long double kineticEnergyOf(const TestScene& scene, const BallStates& states) {
  long double sum = 0;
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    const double mass = scene.balls[states.ids[i]].mass;
    if (mass == kFixed) continue;
    const VectorOf<long double> v = states.velocities[i].cast<long double>();
    sum += static_cast<long double>(mass) * dot(v, v) / 2;
  }
  return sum;
}

/// Sum of m v, kg m/s, over balls that are not fixed.
inline VectorOf<long double> momentumOf(const TestScene& scene, const BallStates& states) {
  VectorOf<long double> sum = VectorOf<long double>::Zero();
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    const double mass = scene.balls[states.ids[i]].mass;
    if (mass == kFixed) continue;
    sum += static_cast<long double>(mass) * states.velocities[i].cast<long double>();
  }
  return sum;
}

}  // namespace test
}  // namespace ball_sim::core
