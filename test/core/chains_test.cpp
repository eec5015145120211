// Chains of balls, and impacts at one instant under the sequential policy.
#include <gtest/gtest.h>

#include <cmath>

#include "support/methods_under_test.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

class Chains : public testing::TestWithParam<std::string> {
 protected:
  /// Balls on a line, radius 0.5, with equal gaps.
  static TestScene line(const std::vector<double>& masses, double gap) {
    TestScene scene;
    for (std::size_t i = 0; i < masses.size(); ++i) {
      scene.balls.push_back(
          {Vector3(double(i) * (1 + gap), 0, 0), Vector3::Zero(), 0.5, masses[i]});
    }
    return scene;
  }
  std::vector<double> finalSpeeds(const TestScene& scene) {
    Trial run(GetParam(), scene);
    run.advanceTo(1000, 10000);
    std::vector<double> speeds;
    for (const Vector3& v : run.states().velocities) speeds.push_back(v.x());
    return speeds;
  }
};

TEST_P(Chains, cradleLetsOutAsManyBallsAsCameIn) {
  for (const double gap : {0.0, 0.125}) {
    for (std::size_t in = 1; in <= 4; ++in) {
      TestScene scene = line({1, 1, 1, 1, 1}, gap);
      for (std::size_t i = 0; i < in; ++i) {
        scene.balls[i].velocity.x() = 1;
        scene.balls[i].position.x() -= 3;
      }
      const std::vector<double> speeds = finalSpeeds(scene);
      for (std::size_t i = 0; i < 5; ++i) {
        EXPECT_EQ(speeds[i], i >= 5 - in ? 1.0 : 0.0)  // equal balls swap exactly
            << "ball " << i << ", gap " << gap << ", " << in << " in";
      }
    }
  }
}

TEST_P(Chains, restitutionRunsDownACradle) {
  TestScene scene = line({1, 1, 1}, 1);
  scene.surroundings.restitution = 0.5;
  scene.balls[0].velocity.x() = 1;
  Trial run(GetParam(), scene);
  run.advanceTo(2.7);  // two impacts: at 1 and at 1 + 1/0.75 s
  // Each impact hands on (1 + e)/2 of the speed and leaves (1 - e)/2.
  EXPECT_EQ(run.velocity(0).x(), 0.25);
  EXPECT_EQ(run.velocity(1).x(), 0.1875);
  EXPECT_EQ(run.velocity(2).x(), 0.5625);
}

TEST_P(Chains, lightHeavyLight) {
  TestScene scene = line({1, 2, 1}, 1e-3);
  scene.balls[0].velocity.x() = 1;
  const std::vector<double> speeds = finalSpeeds(scene);
  EXPECT_NEAR(speeds[0], -1.0 / 3, 1e-15);
  EXPECT_NEAR(speeds[1], 2.0 / 9, 1e-15);
  EXPECT_NEAR(speeds[2], 8.0 / 9, 1e-15);
}

TEST_P(Chains, halvingMassesSpeedUpTheLast) {
  TestScene scene = line({1, 1.0 / 2, 1.0 / 4, 1.0 / 8, 1.0 / 16, 1.0 / 32}, 0.25);
  scene.balls[0].velocity.x() = 1;
  EXPECT_NEAR(finalSpeeds(scene)[5], std::pow(4.0 / 3, 5), 1e-14);
}

// Both contacts at one instant: the smaller ids first. Left first (-13, -10, 33)/27.
TEST_P(Chains, smallerIdsGoFirst) {
  TestScene scene = line({1, 2, 1}, 0);
  scene.balls[0].velocity.x() = 1;
  scene.balls[2].velocity.x() = -1;
  const std::vector<double> left_first = finalSpeeds(scene);
  EXPECT_NEAR(left_first[0], -13.0 / 27, 1e-15);
  EXPECT_NEAR(left_first[1], -10.0 / 27, 1e-15);
  EXPECT_NEAR(left_first[2], 33.0 / 27, 1e-15);
  std::swap(scene.balls[0], scene.balls[2]);  // now the right pair has the smaller ids
  const std::vector<double> right_first = finalSpeeds(scene);
  EXPECT_NEAR(right_first[2], -33.0 / 27, 1e-15);
  EXPECT_NEAR(right_first[1], 10.0 / 27, 1e-15);
  EXPECT_NEAR(right_first[0], 13.0 / 27, 1e-15);
}

// Cue ball into two balls at +-30 degrees that touch each other.
TestScene breakOfTwo() {
  TestScene scene;
  const double x = std::sqrt(0.75);
  scene.balls = {{Vector3(0, 0, 0), Vector3(1, 0, 0), 0.5, 1},
                 {Vector3(x, 0.5, 0), Vector3::Zero(), 0.5, 1},
                 {Vector3(x, -0.5, 0), Vector3::Zero(), 0.5, 1}};
  return scene;
}

TEST_P(Chains, cueBallIntoTwoTakesThemInTurn) {
  Trial run(GetParam(), breakOfTwo());
  run.advanceTo(1e-6);
  const double h = std::sqrt(3.0) / 2;
  EXPECT_NEAR(run.velocity(1).norm(), h, 1e-14);
  EXPECT_NEAR(run.velocity(2).norm(), h / 2, 1e-14);
  EXPECT_NEAR((run.velocity(0) - Vector3(-1.0 / 8, -h / 4, 0)).norm(), 0, 1e-14);
  EXPECT_NEAR((run.velocity(0) + run.velocity(1) + run.velocity(2) - Vector3(1, 0, 0)).norm(), 0,
              1e-15);
}

TEST_P(Chains, threeDimensionalImpactIsRational) {
  TestScene scene;
  scene.balls = {{Vector3(-12, 4, -8), Vector3(3, -1, 2), 1, 2},
                 {Vector3(5, -6.5, 15), Vector3(-1, 2, -3), 2.5, 5}};
  Trial run(GetParam(), scene);
  run.advanceTo(10);
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_NEAR(run.collisions()[0].time.seconds(), 4, 1e-14);
  EXPECT_LT((run.collisions()[0].normal - Vector3(2, 3, 6) / 7).norm(), 1e-14);
  EXPECT_LT((run.collisions()[0].point - (Vector3(0, 0, 0) + Vector3(2, 3, 6) / 7)).norm(), 1e-13);
  EXPECT_LT((run.velocity(0) - Vector3(449, -1213, -1054) / 343).norm(), 1e-14);
  EXPECT_LT((run.velocity(1) - Vector3(-111, 1034, -333) / 343).norm(), 1e-14);
  EXPECT_LT((run.position(0) - Vector3(2694, -7278, -6324) / 343).norm(), 1e-13);
  EXPECT_LT((run.position(1) - Vector3(-323 / 343.0, 13437 / 686.0, -969 / 343.0)).norm(), 1e-13);
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, Chains, testing::ValuesIn(exactMethods()), methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
