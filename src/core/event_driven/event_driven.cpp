#include "event_driven/event_driven.hpp"

#include "event_driven/make_event_driven.hpp"

namespace ball_sim::core {

std::unique_ptr<Method> makeEventDriven(const Surroundings& surroundings,
                                        const MethodSettings& settings) {
  const bool falls = surroundings.gravity != Vector3::Zero();
  const SimultaneousImpacts policy = settings.simultaneous_impacts;
  if (settings.precision == Precision::long_double) {
    if (falls) return std::make_unique<EventDriven<long double, true>>(surroundings, policy);
    return std::make_unique<EventDriven<long double, false>>(surroundings, policy);
  }
  if (falls) return std::make_unique<EventDriven<double, true>>(surroundings, policy);
  return std::make_unique<EventDriven<double, false>>(surroundings, policy);
}

}  // namespace ball_sim::core
