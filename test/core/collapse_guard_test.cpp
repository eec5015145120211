// The guard against collapse lets the physics be where impacts are few, and ends it where they
// would have no end.
#include "ball_sim/collapse_guard.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/methods_under_test.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

TEST(ImpactHistory, needsARunOfQuickImpacts) {
  ImpactHistory<double> history;
  for (std::uint32_t i = 0; i < kLongestCascade; ++i) {
    EXPECT_FALSE(history.record(0, 1, 1)) << i;  // the first is never quick
  }
  EXPECT_TRUE(history.record(0, 1, 1));
  EXPECT_TRUE(history.record(0, 1, 1));
  EXPECT_FALSE(history.record(1, 1, 1)) << "a flight of 1 ends the run";
  EXPECT_FALSE(history.record(1, 1, 1));
}

TEST(ImpactHistory, quickIsADistance) {
  ImpactHistory<double> slow;
  for (int i = 0; i < 200; ++i) slow.record(i * 1e-3, 1e-9, 1);  // 1e-12 between impacts
  EXPECT_TRUE(slow.record(0.2, 1e-9, 1));
  ImpactHistory<double> fast;
  for (int i = 0; i < 200; ++i) EXPECT_FALSE(fast.record(i * 1e-9, 1e6, 1));  // 1e-3 between
}

TEST(LeastRebound, onlyWhereSomethingPresses) {
  EXPECT_EQ(leastRebound<double>(0, 1), 0);
  EXPECT_EQ(leastRebound<double>(-1, 1), 0);
  // Rises by kHumHeight of the reach: v^2 = 2 g h.
  EXPECT_NEAR(leastRebound<double>(10, 0.1), std::sqrt(2 * 10 * 0.1 * kHumHeight), 1e-18);
}

class Collapse : public testing::TestWithParam<std::string> {};

// Three equal balls in a row, the outer two pressing on the one at rest between them.
TestScene threeInARow(double restitution) {
  TestScene scene;
  scene.surroundings.restitution = restitution;
  scene.balls = {{Vector3(-2, 0, 0), Vector3(1, 0, 0), 0.5, 1},
                 {Vector3(0, 0, 0), Vector3(0, 0, 0), 0.5, 1},
                 {Vector3(2.1, 0, 0), Vector3(-1, 0, 0), 0.5, 1}};
  return scene;
}

/// Impacts of three balls in a row by the bare law, without guard, in long double: counts until
/// they part, or `most`.
int impactsWithoutGuard(double restitution, int most) {
  long double x[3] = {-2, 0, 2.1L};
  long double v[3] = {1, 0, -1};
  for (int n = 0; n < most; ++n) {
    long double wait[2];
    for (int i = 0; i < 2; ++i) {
      const long double u = v[i] - v[i + 1];
      const long double gap = x[i + 1] - x[i] - 1;
      wait[i] = u > 0 ? std::max(gap, 0.0L) / u : INFINITY;
    }
    const int first = wait[1] < wait[0] ? 1 : 0;
    if (std::isinf(wait[first])) return n;
    for (int i = 0; i < 3; ++i) x[i] += v[i] * wait[first];
    const long double change = (1 + restitution) / 2 * (v[first] - v[first + 1]);
    v[first] -= change;
    v[first + 1] += change;
  }
  return most;
}

TEST_P(Collapse, endsBelowTheThreshold) {  // e < 7 - 4 sqrt(3) = 0.0718 (McNamara, Young 1992)
  ASSERT_EQ(impactsWithoutGuard(0.06, 500), 500) << "this is a collapse";
  const TestScene scene = threeInARow(0.06);
  Trial run(GetParam(), scene);
  run.advanceTo(100, 10000);
  EXPECT_GT(run.collisions().size(), 20u);
  EXPECT_NEAR(static_cast<double>(momentumOf(scene, run.states()).norm()), 0, 1e-14);
  // All clustered: what is left of the speeds is 0.06^(some) of them.
  EXPECT_LT(kineticEnergyOf(scene, run.states()), 1e-6);
  EXPECT_LT(run.method().statistics().deepest_overlap, 1e-14);
}

TEST_P(Collapse, doesNotTouchWhatLiesAboveTheThreshold) {
  for (const double e : {0.08, 0.1, 0.2, 0.5, 0.9}) {
    const int impacts = impactsWithoutGuard(e, 500);
    ASSERT_LT(impacts, 500);
    Trial run(GetParam(), threeInARow(e));
    run.advanceTo(1000, 10000);
    EXPECT_EQ(run.collisions().size(), static_cast<std::size_t>(impacts)) << "e = " << e;
  }
}

TEST_P(Collapse, ballBetweenWallAndHeavierBallStops) {
  TestScene scene;  // a heavy ball squeezes a light one against a wall
  scene.surroundings.restitution = 0.3;
  scene.surroundings.box.min.x() = 0;
  scene.balls = {{Vector3(1, 0, 0), Vector3(0, 0, 0), 0.5, 1},
                 {Vector3(3, 0, 0), Vector3(-1, 0, 0), 0.5, 1000}};
  Trial run(GetParam(), scene);
  run.advanceTo(1000, 10000);
  EXPECT_GE(run.position(0).x(), 0.5 - 1e-12);
  EXPECT_GE(run.position(1).x() - run.position(0).x(), 1 - 1e-12);
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, Collapse, testing::ValuesIn(exactMethods()), methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
