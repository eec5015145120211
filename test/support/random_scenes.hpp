// Seeded random scenes of every kind the exact methods have to get right.
#pragma once

#include <cmath>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "random_numbers.hpp"
#include "trial.hpp"

namespace ball_sim::core {
namespace test {

enum class Boundary { open, closed, half_open, periodic, planes };

/// What a random scene is made of. Its box is a unit cube (or square), or `edge` if periodic.
struct SceneKind {
  std::string name;
  bool planar = false;
  Boundary boundary = Boundary::closed;
  std::size_t count = 16;
  double largest_radius = 0.08;  ///< m
  std::size_t large = 1;         ///< so many of the balls have it
  double size_ratio = 1;         ///< largest radius : smallest radius
  double small_from = 0;  ///< where the others' sizes begin: a share of the ratio's logarithm
  double mass_ratio = 1;  ///< masses from 1 to this, evenly in the logarithm
  std::size_t fixed = 0;  ///< so many of the balls are fixed
  double gravity = 0;     ///< m/s^2
  double restitution = 1;
  double speed = 1;           ///< m/s, standard deviation of each component
  double offset = 0;          ///< m, the whole scene lies so far from the origin along x
  double edge = 1;            ///< m, of a periodic box
  double simulated_time = 3;  ///< s
};

inline std::ostream& operator<<(std::ostream& out, const SceneKind& kind) {
  return out << kind.name;
}

namespace detail {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

inline Surroundings surroundingsOf(const SceneKind& kind, RandomNumbers& random) {
  Surroundings around;
  const double side = kind.boundary == Boundary::periodic ? kind.edge : 1;
  if (kind.boundary != Boundary::open && kind.boundary != Boundary::planes) {
    around.box.min = Vector3::Zero();
    around.box.max = Vector3::Constant(side);
  }
  if (kind.boundary == Boundary::half_open) {
    around.box.max.x() = kInfinite;
    around.box.min.y() = -kInfinite;
  }
  around.periodic = kind.boundary == Boundary::periodic;
  if (kind.boundary == Boundary::planes) {  // tilted faces around the unit cube
    for (int face = 0; face < (kind.planar ? 4 : 6); ++face) {
      const int axis = face / 2;
      const double sign = face % 2 == 0 ? 1 : -1;
      Vector3 normal = sign * Vector3::Unit(axis) + 0.3 * random.gaussianVector(0.5);
      if (kind.planar) normal.z() = 0;
      normal /= normal.norm();
      const Vector3 foot = Vector3::Constant(0.5) - 0.5 * sign * Vector3::Unit(axis);
      around.planes.push_back({normal, dot(normal, foot)});
    }
  }
  if (kind.planar) around.box.min.z() = around.box.max.z() = 0;
  around.box.min.x() += kind.offset;
  around.box.max.x() += kind.offset;
  for (Plane& plane : around.planes) plane.offset += plane.normal.x() * kind.offset;
  around.gravity = kind.planar ? Vector3(0, -kind.gravity, 0) : Vector3(0, 0, -kind.gravity);
  around.restitution = kind.restitution;
  return around;
}

}  // namespace detail

/// Whether a ball is clear of all walls and balls of a scene, by a margin.
/// @param ignore  place in `balls` of one that is left out
inline bool isFree(const Surroundings& around, const std::vector<Ball>& balls, const Ball& ball,
                   std::size_t ignore = ~std::size_t{0}) {
  const double margin = 1.001;  // far more than rounding: the start is not a contact
  for (int axis = 0; axis < (around.planar() ? 2 : 3) && !around.periodic; ++axis) {
    if (ball.position[axis] - margin * ball.radius < around.box.min[axis]) return false;
    if (ball.position[axis] + margin * ball.radius > around.box.max[axis]) return false;
  }
  for (const Plane& plane : around.planes) {
    if (dot(plane.normal, ball.position) - plane.offset < margin * ball.radius) return false;
  }
  for (std::size_t i = 0; i < balls.size(); ++i) {
    Vector3 dx = balls[i].position - ball.position;
    for (int axis = 0; axis < (around.planar() ? 2 : 3) && around.periodic; ++axis) {
      const double edge = around.box.max[axis] - around.box.min[axis];
      dx[axis] -= edge * std::round(dx[axis] / edge);
    }
    if (i != ignore && dx.norm() < margin * (balls[i].radius + ball.radius)) return false;
  }
  return true;
}

/// A place in the unit cube (or the periodic box) of a scene, in its plane if it is planar.
inline Vector3 randomPlace(const SceneKind& kind, RandomNumbers& random) {
  const double side = kind.boundary == Boundary::periodic ? kind.edge : 1;
  Vector3 place;
  for (int axis = 0; axis < 3; ++axis) place[axis] = random.uniform(0, side);
  if (kind.planar) place.z() = 0;
  place.x() += kind.offset;
  return place;
}

/// A velocity of the scene's speed, in its plane if it is planar.
inline Vector3 randomVelocity(const SceneKind& kind, RandomNumbers& random) {
  Vector3 velocity = random.gaussianVector(kind.speed);
  if (kind.planar) velocity.z() = 0;
  return velocity;
}

/// One more ball for a scene, of the kind's sizes and masses, placed free of the others.
/// @return false when no free place was found in 2000 tries
inline bool addRandomBall(const SceneKind& kind, const Surroundings& around, bool fixed,
                          RandomNumbers& random, std::vector<Ball>& balls) {
  Ball ball;
  // The first balls are of the largest, then evenly in the logarithm.
  const double exponent = balls.size() < kind.large ? 0 : random.uniform(kind.small_from, 1);
  ball.radius = kind.largest_radius * std::pow(kind.size_ratio, -exponent);
  ball.mass = fixed ? kFixed : std::pow(kind.mass_ratio, random.uniform(0, 1));
  if (!fixed) ball.velocity = randomVelocity(kind, random);
  for (int tries = 0; tries < 2000; ++tries) {
    ball.position = randomPlace(kind, random);
    if (!isFree(around, balls, ball)) continue;
    balls.push_back(ball);
    return true;
  }
  return false;
}

/// A scene of a kind; the same seed gives the same scene.
inline TestScene randomScene(const SceneKind& kind, std::uint64_t seed) {
  RandomNumbers random(seed);
  TestScene scene;
  scene.surroundings = detail::surroundingsOf(kind, random);
  for (std::size_t i = 0; i < kind.count; ++i) {
    if (!addRandomBall(kind, scene.surroundings, i < kind.fixed, random, scene.balls)) break;
  }
  return scene;
}

/// Kinds that span what scenes can be: boundaries, dimensions, sizes, masses, forces.
inline std::vector<SceneKind> sceneKinds() {
  std::vector<SceneKind> kinds;
  const auto add = [&kinds](const std::string& name, auto&&... changes) {
    SceneKind kind;
    (changes(kind), ...);
    kind.name = name;
    kinds.push_back(kind);
  };
  const auto planar = [](SceneKind& k) { k.planar = true; };
  const auto in = [](Boundary boundary) {
    return [boundary](SceneKind& k) { k.boundary = boundary; };
  };
  const auto count = [](std::size_t n) { return [n](SceneKind& k) { k.count = n; }; };
  const auto radius = [](double r) { return [r](SceneKind& k) { k.largest_radius = r; }; };
  const auto sizes = [](double ratio) { return [ratio](SceneKind& k) { k.size_ratio = ratio; }; };
  const auto from = [](double share) { return [share](SceneKind& k) { k.small_from = share; }; };
  const auto specks = [](std::size_t large, double ratio) {
    return [large, ratio](SceneKind& k) {
      k.large = large;
      k.size_ratio = ratio;
      k.small_from = 0.7;
    };
  };
  const auto masses = [](double ratio) { return [ratio](SceneKind& k) { k.mass_ratio = ratio; }; };
  const auto fixed = [](std::size_t n) { return [n](SceneKind& k) { k.fixed = n; }; };
  const auto gravity = [](double g) { return [g](SceneKind& k) { k.gravity = g; }; };
  const auto bounce = [](double e) { return [e](SceneKind& k) { k.restitution = e; }; };
  const auto fast = [](SceneKind& k) {
    k.speed = 1e5;
    k.simulated_time = 3e-5;
  };
  const auto far = [](SceneKind& k) { k.offset = 1e4; };
  const auto edge = [](double e) { return [e](SceneKind& k) { k.edge = e; }; };
  const auto time = [](double t) { return [t](SceneKind& k) { k.simulated_time = t; }; };

  add("open_2d", planar, in(Boundary::open), count(30));
  add("open_3d", in(Boundary::open), radius(0.12));
  add("open_3d_fast", in(Boundary::open), radius(0.12), fast);
  add("open_3d_gravity_fixed", in(Boundary::open), radius(0.1), gravity(10), fixed(6));
  add("closed_2d", planar);
  add("closed_3d", count(24));
  add("closed_3d_dense", count(40), radius(0.11), time(1));
  add("closed_2d_ratio_10", planar, sizes(10), masses(100));
  add("closed_3d_ratio_10", sizes(10), masses(1000), radius(0.15));
  add("closed_2d_ratio_1000", planar, sizes(1000), radius(0.2), count(24));
  add("closed_3d_ratio_1000", sizes(1000), radius(0.3), count(24), masses(1e6));
  add("closed_3d_ratio_10000", sizes(1e4), radius(0.3), count(24), masses(1e6));
  // Several large balls among so many small ones that their guests' cells are halved: once, twice,
  // three times; and with balls of a level between.
  add("several_large_2d", planar, radius(0.2), specks(3, 100), count(100), time(0.2));
  add("several_large_3d", radius(0.2), specks(4, 100), count(232), time(0.04));
  add("several_large_once_halved", radius(0.2), specks(4, 30), count(74), time(0.2));
  add("several_large_three_levels", planar, radius(0.2), specks(3, 1000), from(0.2), count(140),
      time(0.05));
  add("several_large_open_2d", planar, in(Boundary::open), radius(0.12), specks(4, 100), count(140),
      time(0.2));
  add("several_large_half_open", in(Boundary::half_open), radius(0.2), specks(4, 100), count(100),
      time(0.1));
  add("several_large_gravity", planar, radius(0.2), specks(3, 100), count(100), gravity(20),
      time(0.15));
  add("several_large_apart", planar, radius(0.12), specks(6, 100), count(140), time(0.15));
  add("several_large_ratio_10", planar, radius(0.2), specks(3, 10), from(0.52), count(42),
      time(0.5));
  add("several_large_periodic_2d", planar, in(Boundary::periodic), radius(0.12), specks(4, 100),
      count(140), time(0.06));
  add("several_large_periodic_3d", in(Boundary::periodic), radius(0.2), specks(4, 100), count(100),
      time(0.1));
  add("closed_3d_fixed", fixed(5), radius(0.1));
  add("closed_2d_fixed", planar, fixed(4), masses(10));
  add("closed_3d_fast", fast);
  add("closed_3d_far", far);
  add("closed_2d_inelastic", planar, bounce(0.7));
  add("closed_3d_inelastic", bounce(0.5), count(24));
  add("closed_3d_very_inelastic", bounce(0.05), count(24));
  add("closed_2d_gravity", planar, gravity(5));
  add("closed_3d_gravity", gravity(10), count(24));
  add("closed_3d_gravity_inelastic", gravity(10), bounce(0.6), count(8), time(1.5));
  add("closed_2d_gravity_inelastic", planar, gravity(10), bounce(0.5), count(6), time(1.5));
  add("closed_3d_gravity_fixed", gravity(10), fixed(4), radius(0.1));
  add("closed_2d_gravity_fixed_inelastic", planar, gravity(10), fixed(4), bounce(0.7), time(1.5));
  add("half_open_2d", planar, in(Boundary::half_open));
  add("half_open_3d", in(Boundary::half_open), radius(0.12));
  add("half_open_3d_gravity", in(Boundary::half_open), gravity(5), sizes(10), radius(0.15));
  add("planes_2d", planar, in(Boundary::planes));
  add("planes_3d", in(Boundary::planes));
  add("planes_3d_gravity", in(Boundary::planes), gravity(10));
  add("planes_3d_gravity_inelastic", in(Boundary::planes), gravity(10), bounce(0.6), count(6));
  add("planes_2d_gravity_inelastic", planar, in(Boundary::planes), gravity(10), bounce(0.6),
      count(5));
  add("periodic_2d", planar, in(Boundary::periodic));
  add("periodic_3d", in(Boundary::periodic), count(24));
  add("periodic_3d_ratio_10", in(Boundary::periodic), sizes(10), radius(0.2), masses(100));
  add("periodic_2d_ratio_1000", planar, in(Boundary::periodic), sizes(1000), radius(0.2));
  add("periodic_3d_inelastic", in(Boundary::periodic), bounce(0.8), radius(0.12));
  add("periodic_2d_fixed", planar, in(Boundary::periodic), fixed(3));
  add("periodic_3d_fixed_gravity", in(Boundary::periodic), fixed(3), gravity(5));
  add("periodic_3d_fast", in(Boundary::periodic), fast);
  add("periodic_3d_far", in(Boundary::periodic), far);
  // Boxes hardly larger than their balls: one ball touches several images of another.
  add("tiny_periodic_2d_one_diameter", planar, in(Boundary::periodic), edge(1.001), radius(0.5),
      sizes(20), count(5));
  add("tiny_periodic_3d_one_diameter", in(Boundary::periodic), edge(1.001), radius(0.5), sizes(20),
      count(6));
  add("tiny_periodic_2d_two_diameters", planar, in(Boundary::periodic), edge(2.01), radius(0.5),
      count(3));
  add("tiny_periodic_3d_two_diameters", in(Boundary::periodic), edge(2.01), radius(0.5), count(4));
  add("tiny_periodic_2d_three_diameters", planar, in(Boundary::periodic), edge(3.01), radius(0.5),
      count(5));
  add("tiny_periodic_3d_three_diameters", in(Boundary::periodic), edge(3.01), radius(0.5),
      count(8));
  add("tiny_periodic_3d_diagonal", in(Boundary::periodic), edge(1.2), radius(0.5), count(2));
  return kinds;
}

}  // namespace test
}  // namespace ball_sim::core
