// Fills: no overlap, inside the walls, reproducible, of the asked sizes, speeds and density.
#include "ball_sim/fill.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "ball_sim/observables.hpp"
#include "support/fills.hpp"

namespace ball_sim::core {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kInf = std::numeric_limits<double>::infinity();

using test::fillOf;

Scene cube(double edge, const Fill& fill) {
  Scene scene;
  scene.surroundings.box = {Vector3::Zero(), Vector3::Constant(edge)};
  scene.fill = {fill};
  return scene;
}

void makePlanar(Scene& scene) {
  scene.surroundings.box.min.z() = scene.surroundings.box.max.z() = 0.5;
}

Scene sized(double packing_fraction, bool periodic, bool planar, Fill fill) {
  Scene scene;
  scene.surroundings.periodic = periodic;
  if (planar) makePlanar(scene);
  fill.packing_fraction = packing_fraction;
  scene.fill = {fill};
  return scene;
}

// Looks at all pairs and walls, with no help from the code under test.
void expectSound(const Scene& scene, const std::vector<Ball>& balls) {
  const Box& box = scene.surroundings.box;
  const int axes = scene.surroundings.planar() ? 2 : 3;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const Ball& a = balls[i];
    for (int axis = 0; axis < axes; ++axis) {
      const double room = scene.surroundings.periodic ? 0 : a.radius;
      ASSERT_GE(a.position[axis], box.min[axis] + room * (1 - 1e-12) - 1e-14) << "ball " << i;
      ASSERT_LE(a.position[axis], box.max[axis] - room * (1 - 1e-12) + 1e-14) << "ball " << i;
    }
    if (axes == 2) {
      ASSERT_EQ(a.position.z(), box.min.z());
      ASSERT_EQ(a.velocity.z(), 0);
    }
    for (const Plane& plane : scene.surroundings.planes) {
      ASSERT_GE(plane.normal.dot(a.position) - plane.offset, a.radius * (1 - 1e-11));
    }
    for (std::size_t j = 0; j < i; ++j) {
      Vector3 between = a.position - balls[j].position;
      for (int axis = 0; scene.surroundings.periodic && axis < axes; ++axis) {
        const double edge = box.max[axis] - box.min[axis];
        between[axis] -= edge * std::round(between[axis] / edge);
      }
      const double reach = a.radius + balls[j].radius;
      ASSERT_GE(between.norm(), reach * (1 - 2e-12)) << "balls " << j << " and " << i;
    }
  }
}

// Every way of placing, closed and periodic, in space and in the plane.
struct Density {
  double packing_fraction;
  bool planar;
  Range radius;
  std::size_t count;
};

class FillAtDensity : public testing::TestWithParam<Density> {};

TEST_P(FillAtDensity, IsSound) {
  const Density& d = GetParam();
  for (const bool periodic : {false, true}) {
    Scene scene = sized(d.packing_fraction, periodic, d.planar, fillOf(d.count, d.radius));
    const std::vector<Ball> balls = populate(scene);
    ASSERT_EQ(balls.size(), d.count);
    expectSound(scene, balls);
    double content = 0;
    for (const Ball& ball : balls) {
      content += d.planar ? kPi * std::pow(ball.radius, 2) : 4 * kPi / 3 * std::pow(ball.radius, 3);
    }
    const Vector3 edges = scene.surroundings.box.max - scene.surroundings.box.min;
    const double room = d.planar ? edges.x() * edges.y() : edges.prod();
    EXPECT_EQ(edges.x(), edges.y());
    // A sum of some thousand terms and a root, rounded.
    EXPECT_NEAR(content / room, d.packing_fraction, 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, FillAtDensity,
    testing::Values(Density{0.05, false, {0.05, 0.05}, 500}, Density{0.29, false, {0.01, 0.2}, 500},
                    Density{0.50, false, {0.1, 0.1}, 300}, Density{0.45, false, {0.02, 0.1}, 300},
                    Density{0.66, false, {0.1, 0.1}, 2048}, Density{0.40, true, {0.1, 0.1}, 500},
                    Density{0.75, true, {0.1, 0.1}, 200}, Density{0.70, true, {0.05, 0.1}, 200},
                    Density{0.85, true, {0.1, 0.1}, 2000}));

// Bits that must not change with machine, compiler or library: seeds name initial states for good.
TEST(Fill, IsTheSameOnEveryMachine) {
  Fill fill = fillOf(50, {0.02, 0.05});
  fill.seed = 12345;
  Scene scene = cube(1, fill);
  const std::vector<Ball> balls = populate(scene);
  BallStates states;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    states.ids.push_back(static_cast<BallId>(i));
    states.positions.push_back(balls[i].position);
    states.velocities.push_back(balls[i].velocity);
  }
  EXPECT_EQ(stateHash(states), 13134132613704346254u);
  // The engine's 10000th number by the C++ standard, [rand.predef].
  std::mt19937_64 engine;
  engine.discard(9999);
  EXPECT_EQ(engine(), 9981545732273789042u);
}

TEST(Fill, SeedsDiffer) {
  Fill fill = fillOf(10, {0.05, 0.05});
  Scene one = cube(1, fill);
  fill.seed = 2;
  Scene two = cube(1, fill);
  const std::vector<Ball> first = populate(one);
  EXPECT_NE(first[0].position, populate(two)[0].position);
  EXPECT_EQ(first[0].position, populate(one)[0].position);
}

TEST(Fill, DrawsEvenlyAndNormally) {
  Fill fill = fillOf(20000, {0.001, 0.003});
  fill.mass = Range{2, 4};
  fill.speed_sigma = 3;
  Scene scene = cube(1, fill);
  const std::vector<Ball> balls = populate(scene);
  const double n = static_cast<double>(balls.size());
  double radius = 0, mass = 0, place = 0, v1 = 0, v2 = 0, v4 = 0;
  for (const Ball& ball : balls) {
    EXPECT_GE(ball.radius, 0.001);
    EXPECT_LE(ball.radius, 0.003);
    radius += ball.radius / n;
    mass += ball.mass / n;
    place += ball.position.y() / n;
    for (int axis = 0; axis < 3; ++axis) {
      const double u = ball.velocity[axis] / 3;
      v1 += u / (3 * n);
      v2 += u * u / (3 * n);
      v4 += u * u * u * u / (3 * n);
    }
  }
  // Five standard deviations of each mean; that of an even draw of width w is w / sqrt(12 n).
  const double even = 5 / std::sqrt(12 * n);
  EXPECT_NEAR(radius, 0.002, 0.002 * even);
  EXPECT_NEAR(mass, 3, 2 * even);
  EXPECT_NEAR(place, 0.5, even);
  // Moments 0, 1, 3 of the normal distribution; variances of u, u^2, u^4: 1, 2, 96.
  EXPECT_NEAR(v1, 0, 5 * std::sqrt(1 / (3 * n)));
  EXPECT_NEAR(v2, 1, 5 * std::sqrt(2 / (3 * n)));
  EXPECT_NEAR(v4, 3, 5 * std::sqrt(96 / (3 * n)));
}

TEST(Fill, DensityMakesMasses) {
  Fill fill = fillOf(20, {0.02, 0.05});
  fill.mass.reset();
  fill.density = 7800;
  Scene scene = cube(1, fill);
  for (const Ball& ball : populate(scene)) {
    EXPECT_NEAR(ball.mass, 7800 * 4 * kPi / 3 * std::pow(ball.radius, 3), 1e-12 * ball.mass);
  }
}

TEST(Fill, FixedObstaclesDoNotMove) {
  Fill fill = fillOf(20, {0.05, 0.05});
  fill.mass = Range{kInf, kInf};
  Scene scene = cube(1, fill);
  for (const Ball& ball : populate(scene)) EXPECT_EQ(ball.velocity, Vector3(0, 0, 0));
}

TEST(Fill, KeepsClearOfBallsFillsAndPlanes) {
  for (const double packed : {0.1, 0.3}) {  // at random, and pushed apart
    Scene scene = cube(1, fillOf(300, {0.04, 0.04}));
    scene.surroundings.planes = {{Vector3(0.6, 0, 0.8), 0.2}};
    scene.balls = {{{0.5, 0.5, 0.5}, Vector3::Zero(), 0.2, 1}};
    Fill larger = fillOf(5, {0.1, 0.1});
    scene.fill.push_back(larger);
    scene.fill[0].count = static_cast<std::size_t>(packed / (4 * kPi / 3 * std::pow(0.04, 3)));
    const std::vector<Ball> balls = populate(scene);
    ASSERT_EQ(balls.size(), 1 + scene.fill[0].count + 5);
    EXPECT_EQ(balls[0].radius, 0.2) << "listed balls first";
    EXPECT_EQ(balls[1].radius, 0.04) << "then the fills, in the order of the scene";
    EXPECT_EQ(balls.back().radius, 0.1);
    expectSound(scene, balls);
  }
}

TEST(Fill, KeepsClearOfPlanesOnALattice) {
  Scene scene = cube(1, fillOf(30000, {0.013, 0.013}));  // 0.28: a lattice, being many
  scene.surroundings.planes = {{Vector3(0.6, 0, 0.8), 0.2}};
  scene.balls = {{{0.5, 0.5, 0.5}, Vector3::Zero(), 0.1, 1}};
  const std::vector<Ball> balls = populate(scene);
  for (std::size_t i = 1; i < balls.size(); ++i) {
    const Vector3& x = balls[i].position;
    ASSERT_GE(Vector3(0.6, 0, 0.8).dot(x) - 0.2, 0.013 * (1 - 1e-11));
    ASSERT_GE((x - Vector3(0.5, 0.5, 0.5)).norm(), 0.113 * (1 - 1e-12));
  }
}

TEST(Fill, SizesTheOpenExtents) {
  Scene scene = sized(0.2, false, false, fillOf(100, {0.05, 0.05}));
  scene.surroundings.box.min = {-1, 3, -kInf};
  scene.surroundings.box.max = {1, kInf, kInf};
  scene.balls = {{{0, 4, 0}, Vector3::Zero(), 0.1, 1}};
  populate(scene);
  // Room for the listed ball and the fill: 2 m by l by l.
  const double content = 4 * kPi / 3 * (100 * std::pow(0.05, 3) + std::pow(0.1, 3));
  const double l = std::sqrt(content / 0.2 / 2);
  const Box& box = scene.surroundings.box;
  EXPECT_EQ(box.min.x(), -1);
  EXPECT_EQ(box.min.y(), 3);
  EXPECT_NEAR(box.max.y(), 3 + l, 1e-14 * 10);
  EXPECT_NEAR(box.min.z(), -l / 2, 1e-14);
  EXPECT_EQ(box.max.z(), -box.min.z());
}

TEST(Fill, RefusesWhatCannotBePacked) {
  const auto reason = [](Scene scene) -> std::string {
    try {
      populate(scene);
    } catch (const PackingError& error) {
      return error.what();
    }
    ADD_FAILURE() << "accepted";
    return "";
  };
  const std::string crowded = reason(cube(1, fillOf(60, {0.12, 0.15})));
  EXPECT_NE(crowded.find("fill[0]: only "), std::string::npos) << crowded;
  EXPECT_NE(crowded.find(" of 60 balls"), std::string::npos) << crowded;
  const std::string wide = reason(cube(1, fillOf(1, {0.6, 0.6})));
  EXPECT_NE(wide.find("wider than the box"), std::string::npos) << wide;
}

}  // namespace
}  // namespace ball_sim::core
