#include "ball_sim/methods.hpp"

#include <algorithm>
#include <stdexcept>

#include "ball_sim/brute_force.hpp"
#include "ball_sim/text.hpp"
#include "continuous/make_continuous.hpp"
#include "event_driven/make_event_driven.hpp"

namespace ball_sim::core {

namespace {

[[noreturn]] void refuse(const std::string& name) {
  throw std::invalid_argument("method: '" + name + "': must be one of " +
                              formatList(methodNames()));
}

}  // namespace

const std::vector<std::string>& methodNames() {
  static const std::vector<std::string> names = {"auto", "event_driven", "continuous",
                                                 "brute_force"};
  return names;
}

MethodChoice chooseMethod(const std::string& name, const Scene& /*scene*/) {
  if (name == "auto") return {"event_driven", "exact to rounding, and fast at any density"};
  const auto& names = methodNames();
  if (std::find(names.begin(), names.end(), name) == names.end()) refuse(name);
  return {name, "asked for"};
}

std::unique_ptr<Method> makeMethod(const std::string& name, const Surroundings& surroundings,
                                   const MethodSettings& settings) {
  if (name == "event_driven") return makeEventDriven(surroundings, settings.precision);
  if (name == "continuous") {
    return makeContinuous(surroundings, settings.precision, settings.threads);
  }
  if (name != "brute_force") refuse(name);
  if (settings.precision == Precision::double_precision) {
    return std::make_unique<BruteForce<double>>(surroundings);
  }
  return std::make_unique<BruteForce<long double>>(surroundings);
}

}  // namespace ball_sim::core
