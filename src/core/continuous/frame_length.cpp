#include "continuous/frame_length.hpp"

#include <cmath>
#include <limits>

namespace ball_sim::core {
namespace {

// Costs in ns, measured: of a ball in a frame, of a path looked at, of a search after an impact.
constexpr double kCostOfBall = 80;
constexpr double kCostOfLook = 2;
constexpr double kCostOfSearch = 230;

}  // namespace

double frameLength(const FrameSurvey& survey) {
  if (!(survey.fastest > 0)) return std::numeric_limits<double>::infinity();
  const double count = static_cast<double>(survey.count);
  const double radius = survey.radii / count;
  const double speed = survey.speeds / count;
  const double density = count / survey.volume;
  const auto looksAt = [&](double length) {
    const double box = 4 * radius + 2 * (speed + survey.fastest) * length;
    return std::min(count, density * box * box * (survey.planar ? 1 : box));
  };
  // Impacts per ball and second; in a thin gas each ball sweeps pi (2 r)^2 (planar: 4 r) ahead.
  const double width = survey.planar ? 4 * radius : 4 * std::acos(-1.0) * radius * radius;
  const double rate = survey.impact_rate ? 2 * *survey.impact_rate / count
                                         : std::sqrt(2.0) * width * density * speed;
  double best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int k = -10; k <= 20; ++k) {
    const double length = std::exp2(k / 2.0) * radius / survey.fastest;
    const double cost = (kCostOfBall + kCostOfLook * looksAt(length) / 2) / length +
                        rate * (kCostOfSearch + kCostOfLook * looksAt(length));
    if (cost < least) {
      least = cost;
      best = length;
    }
  }
  return best;
}

}  // namespace ball_sim::core
