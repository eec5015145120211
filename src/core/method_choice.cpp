#include "ball_sim/method_choice.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "ball_sim/text.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Balls of like size, as one: sums over pairs of classes stand for sums over pairs of balls.
struct SizeClass {
  double count = 0;
  double radius = 0;  // m, mean
  double speed2 = 0;  // m^2/s^2, mean square of a component of the velocity
  bool fixed = false;
};

Vector3 commonVelocity(const std::vector<Ball>& balls) {
  Vector3 momentum = Vector3::Zero();
  double mass = 0;
  for (const Ball& ball : balls) {
    if (std::isinf(ball.mass)) return Vector3::Zero();  // the fixed balls are the frame
    momentum += ball.mass * ball.velocity;
    mass += ball.mass;
  }
  return mass > 0 ? Vector3(momentum / mass) : Vector3(Vector3::Zero());
}

std::vector<SizeClass> classesOf(const std::vector<Ball>& balls, bool fixed, const Vector3& common,
                                 int dimension) {
  constexpr std::size_t kMostClasses = 32;
  std::vector<const Ball*> sorted;
  for (const Ball& ball : balls) {
    if (std::isinf(ball.mass) == fixed) sorted.push_back(&ball);
  }
  std::sort(sorted.begin(), sorted.end(),
            [](const Ball* a, const Ball* b) { return a->radius < b->radius; });
  const std::size_t number = std::min(kMostClasses, sorted.size());
  std::vector<SizeClass> classes;
  for (std::size_t k = 0; k < number; ++k) {
    const std::size_t begin = k * sorted.size() / number;
    const std::size_t end = (k + 1) * sorted.size() / number;
    SizeClass size;
    size.fixed = fixed;
    size.count = static_cast<double>(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const Vector3 v = fixed ? Vector3(Vector3::Zero()) : Vector3(sorted[i]->velocity - common);
      size.radius += sorted[i]->radius / size.count;
      size.speed2 += dot(v, v) / (dimension * size.count);
    }
    classes.push_back(size);
  }
  return classes;
}

// sum of n (2 r)^power times pi/6 (planar: pi/4); with the highest power the packing fraction
double moment(const std::vector<SizeClass>& classes, double volume, int power, bool planar) {
  double sum = 0;
  for (const SizeClass& size : classes) sum += size.count * std::pow(2 * size.radius, power);
  return (planar ? kPi / 4 : kPi / 6) * sum / volume;
}

// Points of ln(mean free path / diameter) against bits per collision, and straight lines between
// them and below. Above, in a gas, a collision multiplies an angle by the free path in diameters.
struct ChaosPoint {
  double log_path;
  double bits;
};

double interpolate(const std::vector<ChaosPoint>& points, double log_path) {
  if (log_path > points.back().log_path) {
    return points.back().bits + (log_path - points.back().log_path) / std::log(2.0);
  }
  std::size_t k = 1;
  while (k + 1 < points.size() && log_path > points[k].log_path) ++k;
  const ChaosPoint& low = points[k - 1];
  const ChaosPoint& high = points[k];
  const double share = (log_path - low.log_path) / (high.log_path - low.log_path);
  return low.bits + share * (high.bits - low.bits);
}

// ln of the mean free path in diameters: 1 / (sqrt(2) pi n s^2 chi), planar 1 / (2 sqrt(2) n s
// chi).
double logFreePath(double eta, bool planar) {
  if (planar) {
    const double chi = (1 - 7 * eta / 16) / ((1 - eta) * (1 - eta));
    return -std::log(2 * std::sqrt(2.0) * (4 * eta / kPi) * chi);
  }
  const double chi = (1 - eta / 2) / std::pow(1 - eta, 3);
  return -std::log(std::sqrt(2.0) * kPi * (6 * eta / kPi) * chi);
}

double spanOf(const std::vector<Ball>& balls, int axis) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Ball& ball : balls) {
    low = std::min(low, ball.position[axis] - ball.radius);
    high = std::max(high, ball.position[axis] + ball.radius);
  }
  return high - low;
}

double volumeOf(const Surroundings& surroundings, const std::vector<Ball>& balls) {
  double volume = 1;
  for (int axis = 0; axis < (surroundings.planar() ? 2 : 3); ++axis) {
    const double edge = surroundings.box.max[axis] - surroundings.box.min[axis];
    volume *= std::isfinite(edge) ? edge : spanOf(balls, axis);
  }
  return volume;
}

}  // namespace

double enskogCollisionRate(const std::vector<Ball>& balls, double volume, bool planar) {
  const int dimension = planar ? 2 : 3;
  const Vector3 common = commonVelocity(balls);
  std::vector<SizeClass> classes = classesOf(balls, false, common, dimension);
  for (const SizeClass& size : classesOf(balls, true, common, dimension)) classes.push_back(size);
  const double eta = std::min(0.99, moment(classes, volume, dimension, planar));
  const double below = moment(classes, volume, dimension - 1, planar);  // xi_2; planar: xi_1
  double rate = 0;
  double movable = 0;
  for (const SizeClass& i : classes) {
    if (i.fixed) continue;
    movable += i.count;
    for (const SizeClass& j : classes) {
      const double reach = i.radius + j.radius;
      const double harmonic = 2 * i.radius * j.radius / reach;  // s_i s_j / (s_i + s_j)
      const double lack = 1 - eta;
      const double root = std::sqrt(i.speed2 + j.speed2);
      if (planar) {
        const double chi = 1 / lack + 9.0 / 8 * below * harmonic / (lack * lack);
        rate += i.count * j.count / volume * chi * 2 * reach * std::sqrt(kPi / 2) * root;
      } else {
        const double chi = 1 / lack + 3 * below * harmonic / (lack * lack) +
                           2 * below * below * harmonic * harmonic / (lack * lack * lack);
        rate += i.count * j.count / volume * chi * kPi * reach * reach * std::sqrt(8 / kPi) * root;
      }
    }
  }
  return movable > 0 ? rate / movable : 0;
}

double chaosBits(double packing_fraction, bool planar) {
  // Measured return errors after time reversal: spheres at number densities 0.9, 0.5 and 0.1 per
  // diameter cubed, discs at area fractions 0.55 and 0.2.
  static const std::vector<ChaosPoint> spheres = {{logFreePath(0.9 * kPi / 6, false), 0.5},
                                                  {logFreePath(0.5 * kPi / 6, false), 1.1},
                                                  {logFreePath(0.1 * kPi / 6, false), 3.3}};
  static const std::vector<ChaosPoint> discs = {{logFreePath(0.55, true), 0.8},
                                                {logFreePath(0.2, true), 2.2}};
  const double eta = std::clamp(packing_fraction, 1e-12, 0.7);
  constexpr double kLeast = 0.2;  // no fluid has less
  return std::max(kLeast, interpolate(planar ? discs : spheres, logFreePath(eta, planar)));
}

double horizonInCollisions(double bits_per_collision, double tolerance) {
  constexpr double kFirstError = 2e-15;  // of a radius, after the first collisions, in double
  return std::max(0.0, std::log2(tolerance / kFirstError) / bits_per_collision);
}

SceneNumbers sceneNumbers(const Surroundings& surroundings, const std::vector<Ball>& balls) {
  SceneNumbers numbers;
  numbers.planar = surroundings.planar();
  numbers.smallest_radius = std::numeric_limits<double>::infinity();
  const Vector3 common = commonVelocity(balls);
  double occupied = 0;  // m^3, planar: m^2
  for (const Ball& ball : balls) {
    const double r = ball.radius;
    occupied += numbers.planar ? kPi * r * r : 4 * kPi / 3 * r * r * r;
    if (std::isinf(ball.mass)) continue;
    ++numbers.balls;
    numbers.mean_radius += r;
    numbers.largest_radius = std::max(numbers.largest_radius, r);
    numbers.smallest_radius = std::min(numbers.smallest_radius, r);
    numbers.mean_speed += (ball.velocity - common).norm();
  }
  if (numbers.balls == 0) return SceneNumbers();
  const auto count = static_cast<double>(numbers.balls);
  numbers.mean_radius /= count;
  numbers.mean_speed /= count;
  numbers.volume = volumeOf(surroundings, balls);
  if (!(numbers.volume > 0)) return numbers;
  numbers.packing_fraction = occupied / numbers.volume;
  numbers.collision_rate = enskogCollisionRate(balls, numbers.volume, numbers.planar);
  numbers.bits_per_collision = chaosBits(numbers.packing_fraction, numbers.planar);
  return numbers;
}

std::optional<double> estimatedCost(const std::string& method, const SceneNumbers& numbers) {
  const auto count = static_cast<double>(numbers.balls);
  const double impacts = count * numbers.collision_rate / 2;  // 1/s, of all balls
  if (method == "event_driven") return impacts * 1e-6;
  return std::nullopt;
}

MethodChoice chooseMethod(const std::string& name, const Scene& scene,
                          const std::vector<Ball>& balls) {
  if (name != "auto") return {name, "asked for"};
  return chooseFor(sceneNumbers(scene.surroundings, balls), scene.tolerance, methodNames());
}

MethodChoice chooseFor(const SceneNumbers& numbers, std::optional<double> tolerance,
                       const std::vector<std::string>& known) {
  MethodChoice choice = {"event_driven", ""};
  if (numbers.areFew()) {
    choice.reason = "few balls: exact at no cost worth saving";
    return choice;
  }
  double least = estimatedCost(choice.name, numbers).value_or(0);
  const double of_event_driven = least;
  for (const std::string& name : known) {
    const std::optional<double> cost = estimatedCost(name, numbers);
    if (!cost || !(*cost < least)) continue;
    least = *cost;
    choice.name = name;
  }
  if (!(numbers.collision_rate > 0)) {
    choice.reason = "nothing moves yet: exact whatever comes";
    return choice;
  }
  const double error = tolerance.value_or(kVisibleError);
  const double horizon = horizonInCollisions(numbers.bits_per_collision, error);
  choice.reason = formatShort(numbers.collision_rate) +
                  " collisions per ball and second, horizon " +
                  formatShort(horizon / numbers.collision_rate) + " s at " + formatShort(error);
  if (choice.name != "event_driven") {
    choice.reason +=
        ", at " + formatShort(least / of_event_driven) + " of the cost of event_driven";
  }
  return choice;
}

}  // namespace ball_sim::core
