#include "continuous/continuous.hpp"

#include "continuous/make_continuous.hpp"

namespace ball_sim::core {

std::unique_ptr<Method> makeContinuous(const Surroundings& surroundings, Precision precision,
                                       unsigned threads) {
  const bool falls = surroundings.gravity != Vector3::Zero();
  if (precision == Precision::long_double) {
    if (falls)
      return std::make_unique<continuous::Continuous<long double, true>>(surroundings, threads);
    return std::make_unique<continuous::Continuous<long double, false>>(surroundings, threads);
  }
  if (falls) return std::make_unique<continuous::Continuous<double, true>>(surroundings, threads);
  return std::make_unique<continuous::Continuous<double, false>>(surroundings, threads);
}

}  // namespace ball_sim::core
