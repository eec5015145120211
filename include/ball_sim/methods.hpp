// All methods by name, and the choice among them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/method.hpp"
#include "ball_sim/scene.hpp"

namespace ball_sim::core {

/// The arithmetic a method runs in. long_double (64-bit significand on x86-64) is slower and there
/// to tell rounding from error: what does not shrink with it is a bug, not rounding.
enum class Precision { double_precision, long_double };

/// How a method is to run. Each method takes what concerns it and leaves the rest.
struct MethodSettings {
  Precision precision = Precision::double_precision;
  double time_step = 1e-3;             ///< s, > 0, for the stepping methods
  std::optional<double> tolerance;     ///< relative to a radius; absent: as exact as can be
  std::optional<double> contact_time;  ///< s, > 0, of soft balls; absent: 50 time steps
  SimultaneousImpacts simultaneous_impacts = SimultaneousImpacts::sequential;
  unsigned threads = 1;  ///< >= 1; changes no bit of the result
};

/// A method's name, and why it was taken.
struct MethodChoice {
  std::string name;
  std::string reason;
};

/// The names a scene may use, `auto` first.
const std::vector<std::string>& methodNames();

/// @throws std::invalid_argument  an unknown name, listing the known ones
void checkMethodName(const std::string& name);

/// Settles `auto`; any other known name is taken as it is.
/// @param balls  all balls of the scene, those that fill it too
MethodChoice chooseMethod(const std::string& name, const Scene& scene,
                          const std::vector<Ball>& balls);

/// @throws std::invalid_argument  a time step, s, that is not finite or not above 0
void checkTimeStep(double time_step);

/// @throws std::invalid_argument  a tolerance, of a radius, that is not above 0 or above 1
void checkTolerance(double tolerance);

/// @param name  a known name other than `auto`
/// @throws std::invalid_argument  an unknown name; a time step the method can't go by
std::unique_ptr<Method> makeMethod(const std::string& name, const Surroundings& surroundings,
                                   const MethodSettings& settings = {});

}  // namespace ball_sim::core
