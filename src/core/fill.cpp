// Turns a scene's data into the balls it starts with.
#include "ball_sim/fill.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "ball_sim/limits.hpp"
#include "ball_sim/random_source.hpp"
#include "ball_sim/text.hpp"
#include "packing.hpp"
#include "pi.hpp"

namespace ball_sim::core {
namespace {

double cubed(double x) { return x * x * x; }

// Volume of balls, or area of discs in a planar scene.
double content(double radius, bool planar) {
  return planar ? kPi * radius * radius : 4.0 / 3.0 * kPi * cubed(radius);
}

// The cube root to the last bit, the same on every machine, which std::cbrt is not: the largest
// double whose cube does not exceed x.
double exactCubeRoot(double x) {
  double root = std::cbrt(x);
  while (cubed(root) > x) root = std::nextafter(root, 0.0);
  while (cubed(std::nextafter(root, kMaxCoordinate)) <= x) {
    root = std::nextafter(root, kMaxCoordinate);
  }
  return root;
}

// The radii a fill's balls will have: the first thing its seed is used for.
std::vector<double> drawRadii(const Fill& fill, RandomSource& random) {
  std::vector<double> radii(fill.count);
  for (double& radius : radii) radius = random.uniform(fill.radius.lower, fill.radius.upper);
  return radii;
}

double totalContent(const Scene& scene) {
  const bool planar = scene.surroundings.planar();
  double total = 0;
  for (const Ball& ball : scene.balls) total += content(ball.radius, planar);
  for (const Fill& fill : scene.fill) {
    RandomSource random(fill.seed);
    for (const double radius : drawRadii(fill, random)) total += content(radius, planar);
  }
  return total;
}

bool open(const Box& box, int axis) {
  return std::isinf(box.min[axis]) || std::isinf(box.max[axis]);
}

// Gives the box's infinite extents one common length, such that all balls of the scene take up
// `packing_fraction` of the box. An extent open on both sides is put around 0.
void sizeBox(Scene& scene, double packing_fraction) {
  Box& box = scene.surroundings.box;
  double length = totalContent(scene) / packing_fraction;
  int open_axes = 0;
  for (int axis = 0; axis < (scene.surroundings.planar() ? 2 : 3); ++axis) {
    if (open(box, axis)) {
      ++open_axes;
    } else {
      length /= box.max[axis] - box.min[axis];
    }
  }
  if (open_axes == 2) length = std::sqrt(length);
  if (open_axes == 3) length = exactCubeRoot(length);
  for (int axis = 0; axis < 3; ++axis) {
    if (!open(box, axis)) continue;
    if (std::isfinite(box.min[axis])) {
      box.max[axis] = box.min[axis] + length;
    } else if (std::isfinite(box.max[axis])) {
      box.min[axis] = box.max[axis] - length;
    } else {
      box.min[axis] = -length / 2;
      box.max[axis] = length / 2;
    }
  }
}

double drawMass(const Fill& fill, double radius, RandomSource& random) {
  if (fill.density) return *fill.density * content(radius, false);
  return random.uniform(fill.mass->lower, fill.mass->upper);
}

Vector3 drawVelocity(const Fill& fill, bool planar, RandomSource& random) {
  Vector3 velocity = Vector3::Zero();
  for (int axis = 0; axis < (planar ? 2 : 3); ++axis) {
    velocity[axis] = fill.speed_sigma * random.normal();
  }
  return velocity;
}

}  // namespace

std::vector<Ball> fillBox(const Fill& fill, const Surroundings& surroundings,
                          const std::vector<Ball>& present) {
  RandomSource random(fill.seed);
  const std::vector<double> radii = drawRadii(fill, random);
  std::vector<Ball> balls(fill.count);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    balls[i].radius = radii[i];
    balls[i].mass = drawMass(fill, radii[i], random);
  }
  for (Ball& ball : balls) {
    // A fixed ball cannot move.
    if (std::isfinite(ball.mass)) {
      ball.velocity = drawVelocity(fill, surroundings.planar(), random);
    }
  }
  placeBalls(balls, surroundings, present, random);
  return balls;
}

std::vector<Ball> populate(Scene& scene) {
  for (const Fill& fill : scene.fill) {
    if (!fill.packing_fraction) continue;
    sizeBox(scene, *fill.packing_fraction);
    break;
  }
  // Large balls first: they are the harder to place.
  std::vector<std::size_t> order(scene.fill.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&scene](std::size_t a, std::size_t b) {
    return scene.fill[a].radius.upper > scene.fill[b].radius.upper;
  });
  std::vector<Ball> present = scene.balls;
  std::vector<std::vector<Ball>> filled(scene.fill.size());
  for (const std::size_t i : order) {
    try {
      filled[i] = fillBox(scene.fill[i], scene.surroundings, present);
    } catch (const PackingError& error) {
      throw PackingError("fill[" + std::to_string(i) + "]: " + error.what());
    }
    present.insert(present.end(), filled[i].begin(), filled[i].end());
  }
  std::vector<Ball> balls = scene.balls;
  for (const std::vector<Ball>& some : filled) balls.insert(balls.end(), some.begin(), some.end());
  return balls;
}

}  // namespace ball_sim::core
