// The linear spring and dashpot between soft balls.
#include "soft_sphere/contact_spring.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ball_sim/walls.hpp"

namespace ball_sim::core {
namespace {

constexpr double kPi = 3.14159265358979323846;

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

ContactSpring contactSpring(double contact_time, double restitution) {
  const double b = -std::log(std::max(restitution, kLeastRestitution)) / contact_time;
  const double frequency = kPi / contact_time;
  return {frequency * frequency + b * b, 2 * b};
}

std::optional<double> contactTimeFor(double tolerance, const std::vector<Ball>& balls,
                                     const Surroundings& surroundings) {
  double fastest = 0;  // m^2/s^2
  double smallest = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) {
    if (std::isinf(ball.mass)) continue;
    fastest = std::max(fastest, dot(ball.velocity, ball.velocity));
    smallest = std::min(smallest, ball.radius);
  }
  const double g = std::sqrt(dot(surroundings.gravity, surroundings.gravity));
  const double speed = 2 * std::sqrt(fastest + 2 * g * farthestFall(balls, surroundings));
  if (!(speed > 0)) return std::nullopt;
  return kPi * tolerance * smallest / speed;
}

}  // namespace ball_sim::core
