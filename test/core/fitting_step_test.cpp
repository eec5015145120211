// The time step of a scene that names none, against the closed forms it is made by.
#include "fitting_step.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "ball_sim/world.hpp"
#include "stepping/hardest_approach.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kRound = 3.14159265358979323846;
constexpr double kFew = 1e-15;  // a few roundings, relative

Ball ball(double z, double speed, double radius) {
  return {Vector3(0, 0, z), Vector3(speed, 0, 0), radius, 1};
}

TEST(HardestApproach, IsOfTheFastestAfterTheFarthestFall) {
  Surroundings floor = floorUnderGravity(10, 1);
  // 5 m down gives 10 m/s, beside 3 m/s of flight.
  const std::vector<Ball> balls = {ball(5.1, 0, 0.1), ball(1, 3, 0.1)};
  EXPECT_NEAR(hardestApproach(balls, floor), 2 * std::sqrt(109.0), 30 * kFew);
  floor.box.min.z() = -kInf;  // 4.1 m: as far as they are spread
  EXPECT_NEAR(hardestApproach(balls, floor), 2 * std::sqrt(9 + 82.0), 30 * kFew);
  floor.gravity = Vector3::Zero();
  EXPECT_EQ(hardestApproach(balls, floor), 6);
  Ball fixed = ball(50, 0, 0.1);
  fixed.mass = kInf;
  EXPECT_EQ(hardestApproach({fixed}, floorUnderGravity(10, 1)), 0) << "it does not fall";
  EXPECT_EQ(hardestApproach({}, floorUnderGravity(10, 1)), 0);
}

TEST(FittingTimeStep, IsAMillisecondWhereNothingAsksForLess) {
  for (const char* method : {"auto", "event_driven", "continuous", "brute_force", "discrete"}) {
    EXPECT_EQ(fittingTimeStep(method, {ball(5, 1, 0.1)}, floorUnderGravity(10, 0.5), {}), 1e-3)
        << method;
  }
  EXPECT_EQ(fittingTimeStep("soft_sphere", {ball(0, 0, 0.1)}, {}, {}), 1e-3) << "nothing moves";
  EXPECT_EQ(fittingTimeStep("soft_sphere", {ball(0, 0.01, 1)}, {}, {}), 1e-3) << "slow";
  EXPECT_EQ(fittingTimeStep("discrete", {}, floorUnderGravity(10, 0.5), {}), 1e-3);
}

TEST(FittingTimeStep, MovesNoBallFarInAStepOfDiscrete) {
  EXPECT_NEAR(fittingTimeStep("discrete", {ball(0, 100, 0.08), ball(1, 0, 0.04)}, {}, {}) / 1e-4, 1,
              kFew);
  EXPECT_EQ(fittingTimeStep("auto", {ball(0, 100, 0.08)}, {}, {}), 1e-3) << "flies exactly";
}

TEST(FittingTimeStep, LetsSmallBallsComeToRest) {
  // sqrt(r/g) = 0.01 s.
  for (const char* method : {"auto", "discrete"}) {
    const std::vector<Ball> balls = {ball(0.001, 0, 0.001), ball(0.2, 0, 0.1)};
    EXPECT_NEAR(
        fittingTimeStep(method, {ball(0.001, 0, 0.001)}, floorUnderGravity(10, 0.9), {}) / 3e-4, 1,
        10 * kFew);
    EXPECT_GT(fittingTimeStep("auto", balls, floorUnderGravity(10, 1), {}), 9e-4) << "none rests";
  }
}

TEST(FittingTimeStep, GivesSoftBallsFiftyStepsAContact) {
  // Two at 4 m/s head-on: t_c = pi tolerance r / (8 m/s).
  const std::vector<Ball> balls = {ball(0, 4, 0.2), ball(1, 0, 0.1)};
  EXPECT_NEAR(fittingTimeStep("soft_sphere", balls, {}, 0.02) / (kRound * 0.02 * 0.1 / 8 / 50), 1,
              kFew);
  EXPECT_NEAR(fittingTimeStep("soft_sphere", balls, {}, {}) / (kRound * 0.1 * 0.1 / 8 / 50), 1,
              kFew);
}

TEST(FittingTimeStep, IsTheWorldsAndTheScenesOwnGoesBeforeIt) {
  Scene scene;
  scene.method = "discrete";
  scene.balls = {ball(0, 100, 0.04)};
  EXPECT_EQ(World(scene).method().reason, "asked for, in steps of 0.0001 s");
  scene.time_step = 0.01;
  EXPECT_EQ(World(scene).method().reason, "asked for, in steps of 0.01 s");
  WorldOptions options;
  options.time_step = 0.02;
  EXPECT_EQ(World(scene, options).method().reason, "asked for, in steps of 0.02 s");
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
