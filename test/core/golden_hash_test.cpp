// The same scene gives the same bits on every x86-64: in every build type, in every instruction
// set, with any number of threads. The states at the end are known by their hashes.
//
// The scenes begin from numbers that are exact in binary, and nothing but + - * / and square roots
// reaches a state: no mathematical library has a say. A hash that changes is no error in itself: it
// tells that the arithmetic has changed, on purpose or not. One that differs from build to build
// is an error.
#include <gtest/gtest.h>

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <functional>
#include <ostream>
#include <string>

#include "ball_sim/observables.hpp"
#include "support/random_numbers.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

/// A scene, and how its state is known at the end.
struct Golden {
  std::string name;
  std::function<TestScene()> scene;
  double end = 0;  ///< s
  std::uint64_t event_driven = 0;
  std::uint64_t continuous = 0;
};

std::ostream& operator<<(std::ostream& out, const Golden& golden) { return out << golden.name; }

/// Each component a multiple of 2^-8 m/s, from -1 to 1.
Vector3 exactVelocity(RandomNumbers& random) {
  const auto component = [&random] { return double(random.index(513)) * 0x1p-8 - 1; };
  const double x = component();
  const double y = component();
  const double z = component();
  return {x, y, z};
}

/// Equal balls of 1 kg in the middles of unit cubes, in a box that they fill.
/// @param layers  of cubes along z; 0: a planar scene
TestScene lattice(int columns, int layers, double radius) {
  TestScene scene;
  scene.surroundings.box = {Vector3::Zero(), Vector3(columns, columns, layers)};
  RandomNumbers random(1);
  for (int i = 0; i < columns * columns * std::max(layers, 1); ++i) {
    Ball ball;
    ball.position = Vector3(i % columns + 0.5, i / columns % columns + 0.5,
                            layers > 0 ? i / (columns * columns) + 0.5 : 0);
    ball.velocity = exactVelocity(random);
    if (layers == 0) ball.velocity.z() = 0;
    ball.radius = radius;
    ball.mass = 1;
    scene.balls.push_back(ball);
  }
  return scene;
}

TestScene periodic(TestScene scene) {
  scene.surroundings.periodic = true;
  return scene;
}

/// With a slope in the box, and a fixed ball above it.
TestScene fallingAmongWalls() {
  TestScene scene = lattice(4, 4, 0.25);
  scene.surroundings.gravity = Vector3(0.5, 0, -4);
  scene.surroundings.restitution = 0.875;
  scene.surroundings.planes = {{Vector3(0.6, 0, 0.8), 0.5}};
  scene.balls[21].velocity = Vector3::Zero();
  scene.balls[21].mass = kFixed;
  return scene;
}

/// Under the open sky: only a floor, and where there are balls is where there are cells.
TestScene onAFloor() {
  TestScene scene = lattice(6, 6, 0.46875);
  scene.surroundings.box = {};
  scene.surroundings.box.min.z() = 0;
  scene.surroundings.gravity = Vector3(0, 0, -4);
  return scene;
}

/// Between large balls lie small ones on the edges of their cubes, and specks at the corners.
TestScene mixedSizes() {
  TestScene scene = lattice(4, 4, 0.4375);
  RandomNumbers random(2);
  const auto add = [&](const Vector3& place, double radius, double mass) {
    scene.balls.push_back({place, exactVelocity(random), radius, mass});
  };
  for (int i = 0; i < 64; ++i) {
    const Vector3 corner(i % 4, i / 4 % 4, i / 16);
    const Vector3 within = corner + Vector3::Constant(0x1p-4);
    add(within, 0x1p-7, 0x1p-12);
    for (int axis = 0; axis < 3; ++axis) add(within + 0.5 * Vector3::Unit(axis), 0x1p-5, 0x1p-9);
  }
  return scene;
}

std::uint64_t hashAtEnd(const Golden& golden, const std::string& method, unsigned threads) {
  MethodSettings settings;
  settings.threads = threads;
  const TestScene scene = golden.scene();
  Trial run(method, scene, settings);
  run.advanceTo(golden.end);
  EXPECT_GT(run.collisions().size(), scene.balls.size());
  return stateHash(run.states());
}

std::string inHex(std::uint64_t hash) {
  char text[32];
  std::snprintf(text, sizeof text, "0x%016" PRIx64, hash);
  return text;
}

class GoldenHash : public testing::TestWithParam<Golden> {
 protected:
  void SetUp() override {
#if !defined(__x86_64__)
    GTEST_SKIP() << "the hashes are those of x86-64";
#endif
  }
};

TEST_P(GoldenHash, EventDriven) {
  EXPECT_EQ(inHex(hashAtEnd(GetParam(), "event_driven", 1)), inHex(GetParam().event_driven));
}

TEST_P(GoldenHash, Continuous) {
  EXPECT_EQ(inHex(hashAtEnd(GetParam(), "continuous", 1)), inHex(GetParam().continuous));
}

TEST_P(GoldenHash, ContinuousOnTwoThreads) {
  EXPECT_EQ(inHex(hashAtEnd(GetParam(), "continuous", 2)), inHex(GetParam().continuous));
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, GoldenHash,
    testing::Values(
        // Cells. Enough balls for both threads to be woken, and time enough to be sorted in memory.
        Golden{"dilute", [] { return periodic(lattice(16, 16, 0.234375)); }, 48, 0xa7d3a9c088cbcddf,
               0x961bffad6a4ba861},
        // Packing 0.39: neighbour lists.
        Golden{"dense", [] { return periodic(lattice(6, 6, 0.453125)); }, 4, 0x744070d61902f627,
               0x5e41255ead5d2aa7},
        Golden{"falling_among_walls", fallingAmongWalls, 2, 0xf68ef98ea837712c, 0x0af4b54a06c4face},
        Golden{"on_a_floor", onAFloor, 4, 0xb1547dae868a2178, 0x8af94c78286e7241},
        Golden{"mixed_sizes", mixedSizes, 4, 0xf5977fb2d7d18e69, 0x73a959d0c492fc54},
        // Two cells along each axis: several images of a ball are in reach.
        Golden{"small_periodic", [] { return periodic(lattice(2, 2, 0.4375)); }, 8,
               0x51aad3bbe9804d69, 0x314d4e5f09719f33},
        // Area fraction 0.48: neighbour lists of discs.
        Golden{"planar", [] { return lattice(12, 0, 0.390625); }, 4, 0x842a9c36c9a335ee,
               0xb6afe18197db0e75}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
