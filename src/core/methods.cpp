#include "ball_sim/methods.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ball_sim/brute_force.hpp"
#include "ball_sim/text.hpp"
#include "continuous/make_continuous.hpp"
#include "discrete/discrete.hpp"
#include "event_driven/make_event_driven.hpp"
#include "soft_sphere/soft_sphere.hpp"

namespace ball_sim::core {

namespace {

[[noreturn]] void refuse(const std::string& name) {
  throw std::invalid_argument("method: '" + name + "': must be one of " +
                              formatList(methodNames()));
}

void refuseJointImpacts(const std::string& name, const MethodSettings& settings) {
  if (settings.simultaneous_impacts == SimultaneousImpacts::sequential) return;
  throw std::invalid_argument("simultaneous_impacts: 'simultaneous': method " + name +
                              " cannot take impacts together; event_driven and brute_force can");
}

}  // namespace

const std::vector<std::string>& methodNames() {
  static const std::vector<std::string> names = {"auto",     "event_driven", "continuous",
                                                 "discrete", "soft_sphere",  "brute_force"};
  return names;
}

void checkMethodName(const std::string& name) {
  const auto& names = methodNames();
  if (std::find(names.begin(), names.end(), name) == names.end()) refuse(name);
}

void checkTimeStep(double time_step) {
  if (time_step > 0 && std::isfinite(time_step)) return;
  throw std::invalid_argument("time_step: " + formatNumber(time_step) +
                              ": must be a finite number of seconds above 0");
}

void checkTolerance(double tolerance) {
  if (tolerance > 0 && tolerance <= 1) return;
  throw std::invalid_argument("tolerance: " + formatNumber(tolerance) +
                              ": must be a share of a radius above 0, at most 1");
}

std::unique_ptr<Method> makeMethod(const std::string& name, const Surroundings& surroundings,
                                   const MethodSettings& settings) {
  checkTimeStep(settings.time_step);
  if (name != "event_driven" && name != "brute_force") refuseJointImpacts(name, settings);
  if (name == "event_driven") return makeEventDriven(surroundings, settings);
  if (name == "continuous") {
    return makeContinuous(surroundings, settings.precision, settings.threads);
  }
  if (name == "discrete") return makeDiscrete(surroundings, settings);
  if (name == "soft_sphere") return makeSoftSphere(surroundings, settings);
  if (name != "brute_force") refuse(name);
  if (settings.precision == Precision::double_precision) {
    return std::make_unique<BruteForce<double>>(surroundings, settings.simultaneous_impacts);
  }
  return std::make_unique<BruteForce<long double>>(surroundings, settings.simultaneous_impacts);
}

}  // namespace ball_sim::core
