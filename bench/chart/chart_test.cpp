// The chart's own tools against what is known without them. Built with BALL_SIM_CHART where the
// tests are.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <tuple>

#include "isolation.hpp"
#include "measurement.hpp"
#include "oracle.hpp"
#include "state_check.hpp"

namespace ball_sim::core::chart {
namespace {

PreparedScene prepared(const std::string& name) {
  for (const ScenePlan& plan : scenePlans()) {
    if (plan.name == name) return prepare(plan, BALL_SIM_SOURCE_DIR);
  }
  throw std::runtime_error("no scene " + name);
}

// The two balls touch at t = 4 s and part with rational velocities.
TEST(Trajectory, ofTwoBallsIsTheRationalOne) {
  const PreparedScene scene = prepared("two_balls");
  const Trajectory truth = trueTrajectory(scene, 10);
  const Vector3 first = Vector3(2694, -7278, -6324) / 343;
  const Vector3 second(-323.0 / 343, 13437.0 / 686, -969.0 / 343);
  const double rounding = 1e-14;  // of coordinates up to 20 m, once
  EXPECT_LT((truth.at(0, 10).position - first).norm(), rounding);
  EXPECT_LT((truth.at(1, 10).position - second).norm(), rounding);
  EXPECT_LT((truth.at(0, 4).position - Vector3(0, 0, 0)).norm(), rounding);
  EXPECT_EQ(truth.at(0, 3.5).velocity, Vector3(3, -1, 2));
  EXPECT_EQ(truth.impactsWithin(0, 10), (std::vector<Impact>{{0, 1}}));
  EXPECT_TRUE(truth.impactsWithin(4.5, 10).empty());
}

// Bounce n comes at 1 + 2 (e + ... + e^n) s, e = 0.9: the fourteenth of them after 14.9 s.
TEST(Trajectory, ofABouncingBallIsTheGeometricSeries) {
  const Trajectory truth = trueTrajectory(prepared("bouncing"), 15);
  EXPECT_EQ(truth.impactsWithin(0, 15).size(), 15u);
  double date = 1;
  double speed = 10;  // m/s at the first impact
  for (int bounce = 0; bounce < 14; ++bounce) {
    speed *= 0.9;
    const double top = date + speed / 10;
    const double height = 0.1 + speed * speed / 20;
    EXPECT_NEAR(truth.at(0, top).position.y(), height, 1e-12) << bounce;  // some ulps of 15 s
    date += 2 * speed / 10;
  }
}

TEST(Trajectory, ofTheBilliardCountsPi) {
  EXPECT_EQ(trueTrajectory(prepared("pi_billiard"), 4).impactsWithin(0, 4).size(), 3141u);
}

// Two codes in 256 bits that share no line of physics: walls in the plane, periodic faces, balls of
// any size and mass. Both keep their motion in doubles, hence the bound: some ulps of 10 m.
TEST(Trajectory, ofTheOracleIsThatOfAllPairs) {
  for (const auto& [name, until, least] :
       {std::tuple<const char*, double, std::size_t>{"twelve_discs", 1.5, 30},
        {"fluid_0.2_100", 0.1, 5},
        {"fluid_0.9_100", 0.005, 5},
        {"polydisperse", 0.05, 5}}) {
    const PreparedScene scene = prepared(name);
    const Trajectory oracle = oracleTrajectory(scene, until);
    const Trajectory all_pairs = allPairsTrajectory(scene, until);
    EXPECT_EQ(oracle.impactsWithin(0, until), all_pairs.impactsWithin(0, until)) << name;
    EXPECT_GE(oracle.impactsWithin(0, until).size(), least) << name;
    for (const double date : {until / 3, until}) {
      EXPECT_LT(largestError(scene, all_pairs, date, statesAt(oracle, date)), 1e-14) << name;
    }
  }
}

TEST(Trajectory, oracleRefusesWhatItDoesNotModel) {
  EXPECT_THROW(oracleTrajectory(prepared("bouncing"), 1), std::invalid_argument);
  EXPECT_THROW(oracleTrajectory(prepared("break_shot"), 1), std::invalid_argument);
}

TEST(StateCheck, findsTheDeepestOverlapOfBallsAndWalls) {
  PreparedScene scene = prepared("twelve_discs");
  BallStates states = statesAt(Trajectory(scene.balls, Vector3::Zero()), 0);
  EXPECT_EQ(deepestOverlap(scene, states), 0);
  const double radius = scene.balls[0].radius;
  states.positions[0].x() = radius - 0.01;
  EXPECT_GE(deepestOverlap(scene, states), 0.01 - 1e-15);
  states.positions[1] = states.positions[0] + Vector3(radius / 2, 0, 0);
  EXPECT_NEAR(deepestOverlap(scene, states), 1.5 * radius, 1e-15);
  EXPECT_EQ(defect(scene, states, energyOf(scene, states)), "");
  EXPECT_EQ(defect(scene, states, energyOf(scene, states) / 3), "energy more than doubled");
  states.positions[0].x() = -2 * radius;
  EXPECT_EQ(defect(scene, states, energyOf(scene, states)), "ball through a wall");
  states.positions[0].x() = std::nan("");
  EXPECT_EQ(defect(scene, states, energyOf(scene, states)), "not finite");
}

// A simulation that lets balls pass through everything: what it gets wrong is known.
class Ghosts final : public Simulation {
 public:
  Ghosts(const std::vector<Ball>& balls, double step) : balls_(balls), step_(step) {}
  void advance(std::uint64_t steps) override {
    for (Ball& ball : balls_) ball.position += double(steps) * step_ * ball.velocity;
  }
  void read(BallStates& states) override {
    states = statesAt(Trajectory(balls_, Vector3::Zero()), 0);
  }
  void takeImpacts(std::vector<Impact>& /*impacts*/) override {}

 private:
  std::vector<Ball> balls_;
  double step_;
};

TEST(Measurement, ofBallsThatPassThroughEachOther) {
  const PreparedScene scene = prepared("two_balls");
  Entrant ghosts;
  ghosts.name = "ghosts";
  ghosts.kind = Kind::stepped;
  ghosts.make = [](const Surroundings&, const std::vector<Ball>& balls, double step) {
    return std::make_unique<Ghosts>(balls, step);
  };
  const Row row = measurePath(scene, trueTrajectory(scene, 10), 10, ghosts, 0.125, 0.5);
  EXPECT_EQ(row.failure, "");
  EXPECT_EQ(row.steps, 79u);
  // The velocity that the lighter ball did not get, for the time since t = 4 s, in R = 3.5 m.
  const Vector3 lacking = Vector3(449, -1213, -1054) / 343 - Vector3(3, -1, 2);
  EXPECT_NEAR(*row.error, lacking.norm() * (0.0625 + 79 * 0.125 - 4) / 3.5, 1e-13);
  EXPECT_NEAR(*row.valid_time, 4 - 0.0625, 0.125);  // one step, the run begins half a step late
  EXPECT_FALSE(row.valid_to_end);
  EXPECT_EQ(*row.missed, 1);
  EXPECT_EQ(*row.extra, 0);
  EXPECT_LT(*row.energy_error, 1e-15);
  EXPECT_GT(*row.overlap, 0.05);  // the closest approach in between is 3.3 m, not 3.5 m
}

TEST(Isolation, givesLinesAndSurvivesACrash) {
  const Outcome good = runIsolated([](const auto& give) { give("one"), give("two"); }, 5);
  EXPECT_EQ(good.lines, (std::vector<std::string>{"one", "two"}));
  EXPECT_EQ(good.failure, "");
  const Outcome crash = runIsolated(
      [](const auto& give) {
        give("one");
        std::raise(SIGABRT);
      },
      5);
  EXPECT_EQ(crash.lines, (std::vector<std::string>{"one"}));
  EXPECT_EQ(crash.failure, "crashed: Aborted");
  const Outcome endless = runIsolated(
      [](const auto&) {
        for (volatile bool on = true; on;) {
        }
      },
      1);
  EXPECT_EQ(endless.failure, "gave no result in time");
  const Outcome waiting = runIsolated([](const auto&) { pause(); }, 1);  // uses no CPU time
  EXPECT_EQ(waiting.failure, "gave no result in time");
}

}  // namespace
}  // namespace ball_sim::core::chart
