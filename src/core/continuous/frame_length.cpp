#include "continuous/frame_length.hpp"

#include <cmath>
#include <limits>

#include "pi.hpp"

namespace ball_sim::core {
namespace {

// Costs in ns, measured; around the optimum twice or half of one changes a run by a few percent.
constexpr double kCostOfBall = 60;     // in a frame
constexpr double kCostOfSearch = 230;  // after an impact
constexpr double kCostOfTest = 0.3;    // of a bounding sphere
constexpr double kCostOfPair = 30;     // whose bounding spheres overlap

// Volume of the cells that a search goes through, in cubes over the reach of two paths: half of it
// at the start of a frame, and after an impact all, as balls have turned, but less time is left.
constexpr double kCubesInSpace = 40;
constexpr double kCubesInPlane = 12;

}  // namespace

double frameLength(const FrameSurvey& survey) {
  if (!(survey.fastest > 0)) return std::numeric_limits<double>::infinity();
  const double count = static_cast<double>(survey.count);
  const double radius = survey.radii / count;
  const double speed = survey.speeds / count;
  const double density = count / survey.volume;
  // Balls in so many cubes of an edge, or squares.
  const auto balls = [&](double cubes, double edge) {
    return std::min(count, cubes * density * edge * edge * (survey.planar ? 1 : edge));
  };
  // Searches per ball and second; in a thin gas each ball sweeps pi (2 r)^2 (planar: 4 r) ahead.
  const double width = survey.planar ? 4 * radius : 4 * kPi * radius * radius;
  const double rate =
      survey.search_rate ? *survey.search_rate / count : std::sqrt(2.0) * width * density * speed;
  double best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int k = -40; k <= 80; ++k) {
    const double length = std::exp2(k / 8.0) * radius / survey.fastest;
    const double tests =
        balls(survey.planar ? kCubesInPlane : kCubesInSpace, 2 * radius + survey.fastest * length);
    const double pairs = balls(survey.planar ? kPi : 4 * kPi / 3, 2 * radius + speed * length);
    const double looks = kCostOfTest * tests + kCostOfPair * pairs;
    const double cost = (kCostOfBall + looks / 2) / length + rate * (kCostOfSearch + looks);
    if (cost < least) {
      least = cost;
      best = length;
    }
  }
  return best;
}

}  // namespace ball_sim::core
