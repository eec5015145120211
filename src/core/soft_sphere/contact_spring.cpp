// The linear spring and dashpot between soft balls.
#include "soft_sphere/contact_spring.hpp"

#include <algorithm>
#include <cmath>

#include "pi.hpp"
#include "stepping/hardest_approach.hpp"

namespace ball_sim::core {

ContactSpring contactSpring(double contact_time, double restitution) {
  const double b = -std::log(std::max(restitution, kLeastRestitution)) / contact_time;
  const double frequency = kPi / contact_time;
  return {frequency * frequency + b * b, 2 * b};
}

std::optional<double> contactTimeFor(double tolerance, const std::vector<Ball>& balls,
                                     const Surroundings& surroundings) {
  const double speed = hardestApproach(balls, surroundings);
  if (!(speed > 0)) return std::nullopt;
  return kPi * tolerance * smallestRadius(balls) / speed;
}

}  // namespace ball_sim::core
