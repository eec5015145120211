#include "event_driven/event_driven.hpp"

#include "event_driven/make_event_driven.hpp"

namespace ball_sim::core {

std::unique_ptr<Method> makeEventDriven(const Surroundings& surroundings, Precision precision) {
  const bool falls = surroundings.gravity != Vector3::Zero();
  if (precision == Precision::long_double) {
    if (falls) return std::make_unique<EventDriven<long double, true>>(surroundings);
    return std::make_unique<EventDriven<long double, false>>(surroundings);
  }
  if (falls) return std::make_unique<EventDriven<double, true>>(surroundings);
  return std::make_unique<EventDriven<double, false>>(surroundings);
}

}  // namespace ball_sim::core
