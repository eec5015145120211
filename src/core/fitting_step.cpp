#include "fitting_step.hpp"

#include <algorithm>
#include <cmath>

#include "discrete/discrete.hpp"
#include "soft_sphere/contact_spring.hpp"
#include "soft_sphere/soft_sphere.hpp"
#include "stepping/hardest_approach.hpp"

namespace ball_sim::core {
namespace {

constexpr double kUsualStep = 1e-3;  // s
// Half of what makes discrete warn: impacts of unlike balls speed some of them up.
constexpr double kFarMove = 0.25;  // of the smallest radius

double stepThatRestsIn(const std::vector<Ball>& balls, const Surroundings& surroundings) {
  const double g = std::sqrt(dot(surroundings.gravity, surroundings.gravity));
  if (g == 0 || !(surroundings.restitution < 1)) return kUsualStep;
  return std::min(kUsualStep, kGoodRestingStep * std::sqrt(smallestRadius(balls) / g));
}

double stepOfDiscrete(const std::vector<Ball>& balls, const Surroundings& surroundings) {
  const double step = stepThatRestsIn(balls, surroundings);
  const double speed = hardestApproach(balls, surroundings) / 2;
  return speed > 0 ? std::min(step, kFarMove * smallestRadius(balls) / speed) : step;
}

double stepOfSoftSphere(const std::vector<Ball>& balls, const Surroundings& surroundings,
                        double overlap) {
  const std::optional<double> contact_time = contactTimeFor(overlap, balls, surroundings);
  return contact_time ? std::min(kUsualStep, *contact_time / kUsualStepsPerContact) : kUsualStep;
}

}  // namespace

double fittingTimeStep(const std::string& method, const std::vector<Ball>& balls,
                       const Surroundings& surroundings, std::optional<double> tolerance) {
  if (method == "auto") return stepThatRestsIn(balls, surroundings);
  if (method == "discrete") return stepOfDiscrete(balls, surroundings);
  if (method != "soft_sphere") return kUsualStep;
  return stepOfSoftSphere(balls, surroundings, tolerance.value_or(kUsualOverlap));
}

}  // namespace ball_sim::core
