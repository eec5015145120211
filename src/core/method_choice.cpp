#include "ball_sim/method_choice.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "ball_sim/text.hpp"
#include "ball_sim/walls.hpp"
#include "pi.hpp"

namespace ball_sim::core {
namespace {

// What a method takes, s: for an impact, and for the way of a ball by the mean distance of balls;
// up to kNearBalls, and from kFarBalls on. And what each ball of the crowd adds to an impact.
struct MethodCosts {
  const char* method;
  double impact, far_impact;
  double move, far_move;
  double crowd;
};
constexpr double kNearBalls = 5e3;  // fit into the cache
constexpr double kFarBalls = 1e5;
constexpr std::array<MethodCosts, 2> kCosts = {
    {{"event_driven", 0.43e-6, 0.8e-6, 0.22e-6, 0.36e-6, 0.15e-6},
     {"continuous", 0.74e-6, 1.05e-6, 0.16e-6, 0.17e-6, 0}}};

// Balls of like size, as one: sums over pairs of classes stand for sums over pairs of balls.
struct SizeClass {
  double count = 0;
  double radius = 0;  // m, mean
  double mass = 0;    // kg, mean
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

// Classes a tenth apart, or more where the sizes span more than a factor of 600.
std::vector<SizeClass> classesOf(const std::vector<Ball>& balls, bool fixed, const Vector3& common,
                                 int dimension) {
  double smallest = std::numeric_limits<double>::infinity();
  double largest = 0;
  for (const Ball& ball : balls) {
    smallest = std::min(smallest, ball.radius);
    largest = std::max(largest, ball.radius);
  }
  const double width = std::max(0.1, std::log(largest / smallest) / 63);
  std::vector<SizeClass> classes(64);
  for (const Ball& ball : balls) {
    if (std::isinf(ball.mass) != fixed) continue;
    SizeClass& size = classes[static_cast<std::size_t>(std::log(ball.radius / smallest) / width)];
    const Vector3 v = fixed ? Vector3(Vector3::Zero()) : Vector3(ball.velocity - common);
    size.fixed = fixed;
    size.count += 1;
    size.radius += ball.radius;
    size.mass += ball.mass;
    size.speed2 += dot(v, v) / dimension;
  }
  classes.erase(std::remove_if(classes.begin(), classes.end(),
                               [](const SizeClass& size) { return size.count == 0; }),
                classes.end());
  for (SizeClass& size : classes) {
    size.radius /= size.count;
    size.mass /= size.count;
    size.speed2 /= size.count;
  }
  return classes;
}

// sum of n (2 r)^power times pi/6 (planar: pi/4); with the highest power the packing fraction
double moment(const std::vector<SizeClass>& classes, double volume, int power, bool planar) {
  double sum = 0;
  for (const SizeClass& size : classes) sum += size.count * std::pow(2 * size.radius, power);
  return (planar ? kPi / 4 : kPi / 6) * sum / volume;
}

// Collisions of a ball of class i with those of class j, 1/s.
double rateOf(const SizeClass& i, const SizeClass& j, double eta, double below, double volume,
              bool planar) {
  const double reach = i.radius + j.radius;
  const double harmonic = 2 * i.radius * j.radius / reach;  // s_i s_j / (s_i + s_j)
  const double lack = 1 - eta;
  const double root = std::sqrt(i.speed2 + j.speed2);
  if (planar) {
    const double chi = 1 / lack + 9.0 / 8 * below * harmonic / (lack * lack);
    return j.count / volume * chi * 2 * reach * std::sqrt(kPi / 2) * root;
  }
  const double chi = 1 / lack + 3 * below * harmonic / (lack * lack) +
                     2 * below * below * harmonic * harmonic / (lack * lack * lack);
  return j.count / volume * chi * kPi * reach * reach * std::sqrt(8 / kPi) * root;
}

// The fluid as classes, with what the rates of all pairs depend on.
struct Mixture {
  Mixture(const std::vector<Ball>& balls, double space, bool is_planar)
      : planar(is_planar), volume(space) {
    const int dimension = planar ? 2 : 3;
    const Vector3 common = commonVelocity(balls);
    classes = classesOf(balls, false, common, dimension);
    for (const SizeClass& size : classesOf(balls, true, common, dimension)) {
      classes.push_back(size);
    }
    eta = std::min(0.99, moment(classes, volume, dimension, planar));
    below = moment(classes, volume, dimension - 1, planar);
  }

  double rate(const SizeClass& i, const SizeClass& j) const {
    return rateOf(i, j, eta, below, volume, planar);
  }

  double rate(const SizeClass& i) const {
    double sum = 0;
    for (const SizeClass& j : classes) sum += rate(i, j);
    return sum;
  }

  bool planar;
  double volume;
  double eta = 0;
  double below = 0;  // xi_2; planar: xi_1
  std::vector<SizeClass> classes;
};

// How far a ball would fall until it meets a wall, m; +infinity: there is none below it.
double fallOf(const Ball& ball, const Vector3& gravity, const std::vector<Wall<double>>& walls) {
  double least = std::numeric_limits<double>::infinity();
  const double size = std::sqrt(dot(gravity, gravity));
  for (const Wall<double>& wall : walls) {
    const double down = -dot(gravity, wall.normal) / size;  // towards the wall, per length of fall
    if (!(down > 1e-9)) continue;
    const double gap = dot(ball.position, wall.normal) - wall.offset - ball.radius;
    least = std::min(least, std::max(gap, 0.0) / down);
  }
  return least;
}

// The mean square of the speeds that the balls gain by falling to the floor, m^2/s^2; 0: they do
// not fall, or for ever, and all alike.
double speed2OfFalls(const Surroundings& surroundings, const std::vector<Ball>& balls) {
  if (surroundings.gravity == Vector3::Zero()) return 0;
  const std::vector<Wall<double>> walls = wallsOf<double>(surroundings);
  double sum = 0;
  double count = 0;
  for (const Ball& ball : balls) {
    const double fall = fallOf(ball, surroundings.gravity, walls);
    if (std::isinf(ball.mass) || std::isinf(fall)) continue;
    sum += 2 * std::sqrt(dot(surroundings.gravity, surroundings.gravity)) * fall;
    count += 1;
  }
  // Half of the way is up again, so to say: half of it is height.
  return count > 0 ? sum / (2 * count) : 0;
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

// Bits per collision at a mean free path, ln of diameters.
double bitsOfPath(double log_path, bool planar) {
  // Measured return errors after time reversal: spheres at number densities 0.9, 0.5 and 0.1 per
  // diameter cubed, discs at area fractions 0.55 and 0.2.
  static const std::vector<ChaosPoint> spheres = {{logFreePath(0.9 * kPi / 6, false), 0.5},
                                                  {logFreePath(0.5 * kPi / 6, false), 1.1},
                                                  {logFreePath(0.1 * kPi / 6, false), 3.3}};
  static const std::vector<ChaosPoint> discs = {{logFreePath(0.55, true), 0.8},
                                                {logFreePath(0.2, true), 2.2}};
  constexpr double kLeast = 0.2;  // no fluid has less
  return std::max(kLeast, interpolate(planar ? discs : spheres, log_path));
}

// How fast errors grow in a mixture, bits per second: of the class where it is fastest. The free
// path counts in sums of radii of the partners; a light partner turns a heavy ball only so much.
double errorGrowth(const Mixture& mixture) {
  double fastest = 0;
  for (const SizeClass& i : mixture.classes) {
    if (i.fixed || !(i.speed2 > 0)) continue;
    const double mean_speed = std::sqrt((mixture.planar ? kPi / 2 : 8 / kPi) * i.speed2);
    const double path = mean_speed / mixture.rate(i);  // m
    double growth = 0;
    for (const SizeClass& j : mixture.classes) {
      const double turn = j.fixed ? 2 : 2 * j.mass / (i.mass + j.mass);  // of equal masses: 1
      const double bits = bitsOfPath(std::log(path / (i.radius + j.radius)), mixture.planar);
      growth += mixture.rate(i, j) * (turn < 1 ? turn * bits : bits + std::log2(turn));
    }
    fastest = std::max(fastest, growth);
  }
  return fastest;
}

// See SceneNumbers::crowd.
double crowdOf(const Mixture& mixture) {
  double count = 0;
  for (const SizeClass& size : mixture.classes) count += size.count;
  double collisions = 0;  // 1/s, of all balls
  double sum = 0;
  for (const SizeClass& size : mixture.classes) {
    if (size.fixed) continue;
    const double collisions_of_size = size.count * mixture.rate(size);
    collisions += collisions_of_size;
    sum += collisions_of_size * std::pow(2 * size.radius, mixture.planar ? 2 : 3);
  }
  return collisions > 0 ? count / mixture.volume * sum / collisions : 0;
}

}  // namespace

double enskogCollisionRate(const std::vector<Ball>& balls, double volume, bool planar) {
  const Mixture mixture(balls, volume, planar);
  double sum = 0;
  double movable = 0;
  for (const SizeClass& size : mixture.classes) {
    if (size.fixed) continue;
    sum += size.count * mixture.rate(size);
    movable += size.count;
  }
  return movable > 0 ? sum / movable : 0;
}

double chaosBits(double packing_fraction, bool planar) {
  return bitsOfPath(logFreePath(std::clamp(packing_fraction, 1e-12, 0.7), planar), planar);
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
  double speed2 = 0;    // m^2/s^2, sum
  for (const Ball& ball : balls) {
    const double r = ball.radius;
    occupied += numbers.planar ? kPi * r * r : 4 * kPi / 3 * r * r * r;
    if (std::isinf(ball.mass)) continue;
    const Vector3 v = ball.velocity - common;
    ++numbers.balls;
    numbers.mean_radius += r;
    numbers.smallest_radius = std::min(numbers.smallest_radius, r);
    numbers.mean_speed += std::sqrt(dot(v, v));
    speed2 += dot(v, v);
  }
  if (numbers.balls == 0) return SceneNumbers();
  const auto count = static_cast<double>(numbers.balls);
  const double fallen = speed2OfFalls(surroundings, balls);
  numbers.settles = fallen > 0 && surroundings.restitution < 1;
  numbers.mean_radius /= count;
  numbers.mean_speed /= count;
  numbers.volume = volumeOf(surroundings, balls);
  if (!(numbers.volume > 0)) return numbers;
  numbers.packing_fraction = occupied / numbers.volume;
  if (!(speed2 > 0)) return numbers;
  const double rate = enskogCollisionRate(balls, numbers.volume, numbers.planar);
  const double faster = std::sqrt(1 + fallen * count / speed2);
  numbers.mean_speed *= faster;
  numbers.collision_rate = rate * faster;
  const Mixture mixture(balls, numbers.volume, numbers.planar);
  numbers.bits_per_collision = errorGrowth(mixture) / rate;
  numbers.crowd = crowdOf(mixture);
  return numbers;
}

double horizonInSeconds(const SceneNumbers& numbers, double tolerance) {
  if (!(numbers.collision_rate > 0)) return std::numeric_limits<double>::infinity();
  return horizonInCollisions(numbers.bits_per_collision, tolerance) / numbers.collision_rate;
}

std::optional<double> estimatedCost(const std::string& method, const SceneNumbers& numbers) {
  const auto costs = std::find_if(kCosts.begin(), kCosts.end(),
                                  [&](const MethodCosts& known) { return method == known.method; });
  if (costs == kCosts.end()) return std::nullopt;
  const auto count = static_cast<double>(numbers.balls);
  const double spacing = std::pow(numbers.volume / count, numbers.planar ? 1.0 / 2 : 1.0 / 3);
  const double moves = spacing > 0 ? numbers.mean_speed / spacing : 0;  // 1/s
  const double outside =                                                // of the cache, a share
      std::clamp(std::log(count / kNearBalls) / std::log(kFarBalls / kNearBalls), 0.0, 1.0);
  const double of_move = costs->move + outside * (costs->far_move - costs->move);
  const double of_impact =
      costs->impact + outside * (costs->far_impact - costs->impact) + costs->crowd * numbers.crowd;
  return count * (of_move * moves + of_impact * numbers.collision_rate / 2);
}

std::vector<std::string> methodsThatKeep(SimultaneousImpacts policy) {
  if (policy == SimultaneousImpacts::sequential) return methodNames();
  return {"event_driven"};
}

MethodChoice chooseMethod(const std::string& name, const Scene& scene,
                          const std::vector<Ball>& balls) {
  if (name != "auto") return {name, "asked for"};
  return chooseFor(sceneNumbers(scene.surroundings, balls), scene.tolerance,
                   methodsThatKeep(scene.simultaneous_impacts));
}

MethodChoice chooseFor(const SceneNumbers& numbers, std::optional<double> tolerance,
                       const std::vector<std::string>& known) {
  MethodChoice choice = {"event_driven", ""};
  if (numbers.areFew()) {
    choice.reason = "few balls: exact at no cost worth saving";
    return choice;
  }
  if (numbers.settles) {
    choice.reason = "balls fall and come to rest: exact until they lie on each other";
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
  choice.reason = formatShort(numbers.collision_rate) +
                  " collisions per ball and second, horizon " +
                  formatShort(horizonInSeconds(numbers, error)) + " s at " + formatShort(error);
  if (choice.name != "event_driven") {
    choice.reason +=
        ", at " + formatShort(least / of_event_driven) + " of the cost of event_driven";
  }
  return choice;
}

}  // namespace ball_sim::core
