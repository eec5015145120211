// Resting contact, method discrete: what lies stays, what must not lie moves, and lying is cheap.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "support/fills.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr double kRadius = 0.05;  // m
constexpr double kGravity = 9.81;
// Resting contacts are left to overlap by 1e-3 of the radius; until the loads of a pile are found
// they give way a little more.
constexpr double kSag = 2e-3 * kRadius;

// Builds without optimisation, the sanitizers' among them, take a hundred times as long.
#ifdef __OPTIMIZE__
constexpr std::size_t kManyBalls = 1000;
constexpr double kManyBallsWidth = 1.2;  // m, of the box
#else
constexpr std::size_t kManyBalls = 60;
constexpr double kManyBallsWidth = 0.4;
#endif

MethodSettings millisecond() {
  MethodSettings settings;
  settings.time_step = 1e-3;
  return settings;
}

Trial discrete(const TestScene& scene) { return Trial("discrete", scene, millisecond()); }

/// `count` balls upon each other, in touch.
TestScene stack(int count, double x = 0) {
  TestScene scene{floorUnderGravity(kGravity, 0.5), {}};
  for (int i = 0; i < count; ++i) {
    scene.balls.push_back({Vector3(x, 0, kRadius * (2 * i + 1)), Vector3::Zero(), kRadius, 1});
  }
  return scene;
}

/// Kinetic and potential energy, J.
double energyOf(const TestScene& scene, const Trial& run) {
  const BallStates states = run.states();
  double sum = double(kineticEnergyOf(scene, states));
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    sum -= scene.balls[states.ids[i]].mass * dot(scene.surroundings.gravity, states.positions[i]);
  }
  return sum;
}

std::uint64_t eventsOf(const Trial& run) { return run.method().statistics().events; }

class Stacks : public testing::TestWithParam<int> {};

TEST_P(Stacks, StandForAHundredSeconds) {
  const int count = GetParam();
  for (const double e : {0.0, 0.5, 0.95}) {
    TestScene scene = stack(count);
    scene.surroundings.restitution = e;
    Trial run = discrete(scene);
    const double before = energyOf(scene, run);
    for (const double t : {1.0, 10.0, 100.0}) {
      run.advanceTo(t);
      for (int i = 0; i < count; ++i) {
        const Vector3& start = scene.balls[static_cast<std::size_t>(i)].position;
        const Vector3 place = run.position(static_cast<BallId>(i));
        EXPECT_EQ(place.x(), 0) << "creeps";
        EXPECT_EQ(place.y(), 0) << "creeps";
        EXPECT_LE(place.z(), start.z() + 1e-15);
        EXPECT_GE(place.z(), start.z() - (i + 1) * kSag) << "sinks";
        EXPECT_EQ(run.velocity(static_cast<BallId>(i)), Vector3(0, 0, 0));
      }
      EXPECT_LE(energyOf(scene, run), before);
    }
    EXPECT_TRUE(run.collisions().empty());
    // A hundred thousand steps, and all but the first few hundred of them cost nothing.
    EXPECT_LT(eventsOf(run), std::uint64_t(1000 * count));
  }
}

INSTANTIATE_TEST_SUITE_P(Heights, Stacks, testing::Values(1, 2, 10));

TEST(Piles, AStackThatIsDroppedComesToRest) {
  TestScene scene = stack(10);
  for (std::size_t i = 0; i < 10; ++i) scene.balls[i].position.z() += 0.01 * double(i + 1);
  Trial run = discrete(scene);
  run.advanceTo(20);
  for (BallId i = 0; i < 10; ++i) {
    EXPECT_NEAR(run.position(i).z(), kRadius * (2 * i + 1), (i + 1) * kSag);
    EXPECT_EQ(run.position(i).x(), 0);
    EXPECT_EQ(run.velocity(i), Vector3(0, 0, 0));
  }
}

/// Balls at random in a box without a lid, which fall in.
/// @param side, height  of the space they begin in, m
TestScene pour(std::size_t count, double side, double height, double restitution) {
  Scene scene;
  scene.surroundings = floorUnderGravity(kGravity, restitution);
  scene.surroundings.box.min = Vector3(0, 0, 0);
  scene.surroundings.box.max = Vector3(side, side, height);
  scene.fill = {fillOf(count, {kRadius, kRadius})};
  return placed(scene);
}

/// Pours, and watches each second what moves and what energy there is.
void expectPileToRest(const TestScene& scene, double time_step, double seconds) {
  MethodSettings settings;
  settings.time_step = time_step;
  Trial run("discrete", scene, settings);
  run.log().capacity = 0;
  const auto count = static_cast<double>(scene.balls.size());
  const double overlap_worth = count * kGravity * kSag;  // J: all sags given back at once
  double energy = energyOf(scene, run);
  std::uint64_t events = 0;
  std::vector<double> awake;  // balls, mean over a second
  for (double t = 1; t <= seconds; t += 1) {
    run.advanceTo(t);
    EXPECT_LE(energyOf(scene, run), energy + overlap_worth) << "energy appeared by " << t;
    energy = energyOf(scene, run);
    awake.push_back(double(eventsOf(run) - events) * time_step);
    events = eventsOf(run);
  }
  EXPECT_NEAR(awake.front(), count, 0.01 * count);
  EXPECT_LE(awake.back(), 0.02 * count);  // some may swing in a hollow for long: no friction
  const BallStates states = run.states();
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    EXPECT_LT(states.velocities[i].norm(), kGravity * time_step);
    EXPECT_GE(states.positions[i].z(), kRadius - kSag);
    for (std::size_t j = 0; j < i; ++j) {
      const double distance = (states.positions[i] - states.positions[j]).norm();
      ASSERT_GE(distance, 2 * kRadius - kSag) << i << " in " << j;
    }
  }
  // Nothing creeps from here on but the few that swing.
  run.advanceTo(seconds + 20);
  const BallStates later = run.states();
  int moved = 0;
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    if ((later.positions[i] - states.positions[i]).norm() > 1e-3 * kRadius) ++moved;
  }
  EXPECT_LE(moved, 0.02 * count);
  EXPECT_NEAR(energyOf(scene, run), energy, overlap_worth);
}

TEST(Piles, AHundredBouncyBallsComeToRest) { expectPileToRest(pour(100, 0.5, 2, 0.9), 1e-3, 8); }

TEST(Piles, AThousandPouredBallsComeToRest) { expectPileToRest(pour(1000, 1.2, 2, 0.5), 2e-3, 8); }

TEST(Piles, ASlopeIsNoPlaceToRest) {
  TestScene scene;
  scene.surroundings.gravity = Vector3(0, 0, -kGravity);
  scene.surroundings.restitution = 0.5;
  scene.surroundings.planes = {{Vector3(0.6, 0, 0.8), 0}};
  scene.balls = {{Vector3(0.6, 0, 0.8) * kRadius, Vector3::Zero(), kRadius, 1}};
  Trial run = discrete(scene);
  run.advanceTo(2);
  const double slid = dot(run.position(0), Vector3(0.8, 0, -0.6));
  // From rest under g sin a = 0.6 g; the first steps are those of a ball that still finds its load.
  EXPECT_NEAR(slid, 0.6 * kGravity / 2 * 4, 1e-2);
  EXPECT_NEAR(dot(run.position(0), Vector3(0.6, 0, 0.8)), kRadius, kSag);
}

TEST(Piles, ABallFallsOffABallItDoesNotStandOn) {
  TestScene scene = stack(1);
  scene.balls[0].mass = kFixed;
  const double off = 0.01;  // of the sum of radii; this grows e-fold in sqrt(2 r/g) = 0.1 s
  scene.balls.push_back(
      {Vector3(2 * kRadius * off, 0, kRadius + 2 * kRadius * std::sqrt(1 - off * off)),
       Vector3::Zero(), kRadius, 1});
  Trial run = discrete(scene);
  run.advanceTo(3);
  EXPECT_NEAR(run.position(1).z(), kRadius, 2 * kSag);
  EXPECT_GT(run.position(1).x(), 2 * kRadius);
}

TEST(Piles, AGrooveHoldsABall) {
  TestScene scene;
  scene.surroundings.gravity = Vector3(0, 0, -kGravity);
  scene.surroundings.restitution = 0.5;
  scene.surroundings.planes = {{Vector3(0.8, 0, 0.6), 0}, {Vector3(-0.8, 0, 0.6), 0}};
  scene.balls = {{Vector3(0.01, 0, 0.2), Vector3::Zero(), kRadius, 1}};
  Trial run = discrete(scene);
  run.advanceTo(20);
  EXPECT_LT(run.position(0).head<2>().norm(), 0.01 * kRadius);
  EXPECT_NEAR(run.position(0).z(), kRadius / 0.6, 2 * kSag);
}

// --- waking

/// Two stacks of three, at x = 0 (ids 0..2) and x = 1 (ids 3..5), asleep.
class Sleepers : public testing::Test {
 protected:
  Sleepers() : scene_(stack(3)) {
    for (const Ball& ball : stack(3, 1).balls) scene_.balls.push_back(ball);
    run_ = std::make_unique<Trial>("discrete", scene_, millisecond());
    run_->advanceTo(2);
    EXPECT_EQ(awakeFor(1), 0);
  }

  /// Mean number of balls awake over the next so many seconds.
  double awakeFor(double seconds) {
    const std::uint64_t before = eventsOf(*run_);
    now_ += seconds;
    run_->advanceTo(now_);
    return double(eventsOf(*run_) - before) / (seconds * 1000);
  }

  double height(BallId id) const { return run_->position(id).z() / kRadius; }

  /// @param radii  above the floor: one sag a contact below it at most
  void expectHeight(BallId id, int radii) const {
    EXPECT_NEAR(height(id), radii, (radii + 1) / 2 * (kSag / kRadius)) << id;
  }

  TestScene scene_;
  std::unique_ptr<Trial> run_;
  double now_ = 2;
};

TEST_F(Sleepers, FallWhenWhatBoreThemIsTakenAway) {
  run_->method().remove(0);
  EXPECT_LE(awakeFor(3), 2);
  expectHeight(1, 1);
  expectHeight(2, 3);
  EXPECT_EQ(run_->collisions().front().a, 1u);
  expectHeight(3, 1);
}

TEST_F(Sleepers, FallWhenWhatBoreThemIsMovedAway) {
  run_->method().setMotion(1, Vector3(5, 0, kRadius), Vector3::Zero());
  awakeFor(3);
  expectHeight(2, 3);
  expectHeight(0, 1);
}

TEST_F(Sleepers, FlyWhenTheyArePushed) {
  run_->method().setVelocity(2, Vector3(0, 0, 2));
  awakeFor(0.2);
  EXPECT_NEAR(run_->position(2).z(), 5 * kRadius + 0.4 - kGravity * 0.02, 1e-4);
  EXPECT_LE(awakeFor(5), 3);
  expectHeight(2, 5);
}

TEST_F(Sleepers, WakeWhenTheyAreHitAndNoOthersDo) {
  // Along the floor against the lowest of the first stack.
  run_->method().insert(9, {Vector3(-0.5, 0, kRadius), Vector3(3, 0, 0), kRadius, 1});
  EXPECT_LE(awakeFor(0.3), 4);
  EXPECT_GT(run_->position(0).x(), 0.1);  // knocked out from under the others
  EXPECT_LT(height(1), 2.9);
  EXPECT_EQ(run_->position(3).x(), 1);
}

TEST_F(Sleepers, BearWhatIsPutOnThem) {
  const double top = run_->position(2).z();
  run_->method().insert(9, {Vector3(0, 0, top + 3 * kRadius), Vector3::Zero(), kRadius, 5});
  awakeFor(5);
  expectHeight(9, 7);
  expectHeight(0, 1);
  EXPECT_EQ(run_->velocity(9), Vector3(0, 0, 0));
  EXPECT_EQ(awakeFor(1), 0);
}

TEST_F(Sleepers, StayPutHoweverTimeIsAdvanced) {
  const BallStates before = run_->states();
  for (int i = 0; i < 1000; ++i) awakeFor(0.00037);
  EXPECT_EQ(run_->states().positions, before.positions);
  EXPECT_EQ(run_->states().velocities, before.velocities);
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
