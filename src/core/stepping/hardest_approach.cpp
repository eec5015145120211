#include "stepping/hardest_approach.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ball_sim/walls.hpp"

namespace ball_sim::core {
namespace {

// What a ball may fall through: down to a wall below it, or as far as the balls are spread, m.
double farthestFall(const std::vector<Ball>& balls, const Surroundings& surroundings) {
  const double g = std::sqrt(dot(surroundings.gravity, surroundings.gravity));
  if (g == 0 || balls.empty()) return 0;
  const Vector3 down = surroundings.gravity / g;
  const auto walls = wallsOf<double>(surroundings);
  double farthest = 0;
  double lowest = -std::numeric_limits<double>::infinity();
  double highest = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) {
    lowest = std::max(lowest, dot(ball.position, down));
    highest = std::min(highest, dot(ball.position, down));
    for (const Wall<double>& wall : walls) {
      const double towards = -dot(down, wall.normal);
      if (!(towards > 1e-3)) continue;  // not below, or as good as upright
      const double gap = dot(ball.position, wall.normal) - wall.offset - ball.radius;
      farthest = std::max(farthest, gap / towards);
    }
  }
  return std::max(farthest, lowest - highest);
}

}  // namespace

double smallestRadius(const std::vector<Ball>& balls) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) {
    if (!std::isinf(ball.mass)) smallest = std::min(smallest, ball.radius);
  }
  return smallest;
}

double hardestApproach(const std::vector<Ball>& balls, const Surroundings& surroundings) {
  if (std::isinf(smallestRadius(balls))) return 0;
  double fastest = 0;  // m^2/s^2
  for (const Ball& ball : balls) {
    if (!std::isinf(ball.mass)) fastest = std::max(fastest, dot(ball.velocity, ball.velocity));
  }
  const double g = std::sqrt(dot(surroundings.gravity, surroundings.gravity));
  return 2 * std::sqrt(fastest + 2 * g * farthestFall(balls, surroundings));
}

}  // namespace ball_sim::core
