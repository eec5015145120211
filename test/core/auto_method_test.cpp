// Method auto at work: it is the method it chose, watches it, and changes over where it should.
#include "ball_sim/auto_method.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "ball_sim/fill.hpp"
#include "ball_sim/observables.hpp"
#include "ball_sim/world.hpp"
#include "support/fills.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

/// `auto` with the balls of a scene.
class AutoRun {
 public:
  explicit AutoRun(Scene scene) : balls_(populate(scene)) {
    MethodSettings settings;
    settings.time_step = scene.time_step.value_or(1e-3);
    settings.tolerance = scene.tolerance;
    settings.simultaneous_impacts = scene.simultaneous_impacts;
    const MethodChoice choice = chooseMethod("auto", scene, balls_);
    method_ = std::make_unique<AutoMethod>(scene.surroundings, settings, choice);
    method_->setCollisionLog(&log_);
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      method_->insert(static_cast<BallId>(i), balls_[i]);
    }
  }

  void advanceTo(double seconds, std::uint64_t most_events = 50'000'000) {
    ASSERT_TRUE(method_->advanceTo(Time::fromSeconds(seconds), most_events))
        << "it is at " << method_->now().seconds() << " s, " << method_->reason();
  }
  AutoMethod& method() { return *method_; }
  std::string name() const { return method_->name(); }
  const std::vector<Ball>& balls() const { return balls_; }
  const CollisionLog& log() const { return log_; }
  BallStates states() const {
    BallStates states;
    method_->read(states);
    return states;
  }
  double energy(const Surroundings& around) const {
    std::vector<double> masses;
    for (const Ball& ball : balls_) masses.push_back(ball.mass);
    return kineticEnergy(states(), masses) + potentialEnergy(states(), masses, around.gravity);
  }

 private:
  std::vector<Ball> balls_;
  CollisionLog log_;
  std::unique_ptr<AutoMethod> method_;
};

Scene gas(std::size_t count) { return periodicScene(fillOf(count, {0.1, 0.1}, 0.2)); }

/// Balls in a column over a floor, the lowest on it.
Scene stack(std::size_t count, double gap) {
  Scene scene;
  scene.surroundings.gravity = Vector3(0, 0, -10);
  scene.surroundings.restitution = 0.5;
  scene.surroundings.box.min = Vector3(-0.05, -0.05, 0);
  scene.surroundings.box.max.x() = scene.surroundings.box.max.y() = 0.05;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 0.05 + static_cast<double>(i) * (0.1 + gap);
    scene.balls.push_back({Vector3(0, 0, z), Vector3::Zero(), 0.05, 1});
  }
  return scene;
}

bool canStep() {
  const auto& names = methodNames();
  return std::find(names.begin(), names.end(), "discrete") != names.end();
}

TEST(AutoMethod, isTheChosenMethodBitForBit) {
  Scene scene = gas(300);
  AutoRun run(scene);
  scene.fill[0].packing_fraction.reset();
  run.advanceTo(3);
  Scene filled = gas(300);
  const std::vector<Ball> balls = populate(filled);
  Trial plain(run.name(), {filled.surroundings, balls});
  plain.advanceTo(3);
  EXPECT_EQ(stateHash(run.states()), stateHash(plain.states()));
  EXPECT_EQ(run.log().entries.size(), plain.collisions().size());
  const Statistics own = run.method().statistics();
  const Statistics others = plain.method().statistics();
  EXPECT_EQ(own.ball_collisions, others.ball_collisions);
  EXPECT_EQ(own.events, others.events);
  EXPECT_EQ(own.virial, others.virial);
  EXPECT_EQ(run.method().changes(), 0u);
}

TEST(AutoMethod, doesNotDependOnHowItIsCalled) {
  Scene scene = stack(6, 0.02);
  AutoRun at_once(scene);
  AutoRun in_pieces(scene);
  at_once.advanceTo(1.5);
  for (int k = 1; k <= 150; ++k) {
    while (!in_pieces.method().advanceTo(Time::fromSeconds(k * 0.01), 777)) {
    }
  }
  in_pieces.advanceTo(1.5);
  EXPECT_EQ(in_pieces.name(), at_once.name());
  EXPECT_EQ(in_pieces.method().changes(), at_once.method().changes());
  EXPECT_EQ(in_pieces.method().statistics().events, at_once.method().statistics().events);
  EXPECT_EQ(stateHash(in_pieces.states()), stateHash(at_once.states()));
}

TEST(AutoMethod, tellsWhenTheHorizonIsPassed) {
  Scene scene = gas(300);
  scene.tolerance = 1e-6;
  AutoRun run(scene);
  const SceneNumbers numbers = [&] {
    Scene filled = gas(300);
    const std::vector<Ball> balls = populate(filled);
    return sceneNumbers(filled.surroundings, balls);
  }();
  const double horizon =
      horizonInCollisions(numbers.bits_per_collision, 1e-6) / numbers.collision_rate;
  // The rate of the run is Enskog's within a few percent.
  run.advanceTo(0.8 * horizon);
  EXPECT_EQ(run.method().reason().find("beyond"), std::string::npos);
  run.advanceTo(1.2 * horizon);
  EXPECT_NE(run.method().reason().find("beyond the horizon"), std::string::npos);
  EXPECT_NE(run.method().reason().find("collisions per ball and second"), std::string::npos);
}

TEST(AutoMethod, aWorldShowsItsReason) {
  Scene scene = gas(100);
  World world(scene);
  EXPECT_EQ(world.method().name, "event_driven");
  EXPECT_NE(world.method().reason.find("horizon"), std::string::npos);
  scene.method = "brute_force";
  scene.fill[0].count = 5;
  World asked(scene);
  EXPECT_EQ(asked.method().name, "brute_force");
  EXPECT_EQ(asked.method().reason, "asked for");
}

TEST(AutoMethod, aStackComesToRestBySteps) {
  if (!canStep()) GTEST_SKIP() << "there is no stepping method";
  const Scene scene = stack(10, 0.01);
  AutoRun run(scene);
  const double before = run.energy(scene.surroundings);
  run.advanceTo(2);
  EXPECT_EQ(run.name(), "discrete");
  EXPECT_EQ(run.method().changes(), 1u);
  EXPECT_NE(run.method().reason().find("balls lie on balls"), std::string::npos);
  run.advanceTo(20);
  EXPECT_EQ(run.method().changes(), 1u) << "it flutters: " << run.method().reason();
  EXPECT_LE(run.energy(scene.surroundings), before);
  const BallStates states = run.states();
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    // At rest, to what a step of gravity does. Each contact below may keep an overlap of 1e-3 r,
    // and the hum before has room for 1e-6 of a diameter.
    const double contacts = static_cast<double>(i + 1);
    EXPECT_LT(states.velocities[i].norm(), 0.02);
    EXPECT_NEAR(states.positions[i].z(), 0.1 * contacts - 0.05, contacts * 5e-5 + 9.81e-6);
  }
}

TEST(AutoMethod, aPileFromTheStartNeedsNoFlood) {
  if (!canStep()) GTEST_SKIP() << "there is no stepping method";
  AutoRun run(stack(10, 0));
  run.advanceTo(0.001);
  EXPECT_EQ(run.name(), "discrete");
  EXPECT_NE(run.method().reason().find("all balls lie still"), std::string::npos)
      << run.method().reason();
  run.advanceTo(10);
  EXPECT_EQ(run.method().changes(), 1u);
}

// At rest, but not for long, or not quite at rest.
TEST(AutoMethod, whatFallsIsNoPile) {
  if (!canStep()) GTEST_SKIP() << "there is no stepping method";
  const auto is_pile = [](const Scene& scene) {
    AutoRun run(scene);
    run.advanceTo(1e-6);
    return run.method().reason().find("all balls lie still") != std::string::npos;
  };
  EXPECT_TRUE(is_pile(stack(3, 0)));
  Scene one_in_the_air = stack(3, 0);
  one_in_the_air.balls[2].position.z() += 1e-3;
  EXPECT_FALSE(is_pile(one_in_the_air));
  Scene pushed = stack(3, 0);
  pushed.balls[2].velocity.x() = 1e-3;
  EXPECT_FALSE(is_pile(pushed));
  Scene side_by_side = stack(2, 0);
  side_by_side.surroundings.box.max = Vector3(1, 1, 1);
  side_by_side.balls[0].position = Vector3(0.5, 0.5, 0.5);
  side_by_side.balls[1].position = Vector3(0.6, 0.5, 0.5);
  EXPECT_FALSE(is_pile(side_by_side));
  side_by_side.balls[0].position.z() = side_by_side.balls[1].position.z() = 0.95;  // at the ceiling
  EXPECT_FALSE(is_pile(side_by_side));
  side_by_side.balls[0].position.z() = side_by_side.balls[1].position.z() = 0.05;
  EXPECT_TRUE(is_pile(side_by_side));
}

TEST(AutoMethod, aStirredPileGoesBackToImpacts) {
  if (!canStep()) GTEST_SKIP() << "there is no stepping method";
  AutoRun run(stack(10, 0.01));
  run.advanceTo(5);
  ASSERT_EQ(run.name(), "discrete");
  for (BallId id = 0; id < 10; ++id) run.method().setVelocity(id, Vector3(0, 0, 2.0 + id));
  run.advanceTo(5.2);
  EXPECT_EQ(run.name(), "event_driven");
  EXPECT_EQ(run.method().changes(), 2u);
  EXPECT_NE(run.method().reason().find("since 5"), std::string::npos) << run.method().reason();
  EXPECT_NE(run.method().reason().find("stirred: half"), std::string::npos)
      << run.method().reason();
  run.advanceTo(12);
  EXPECT_EQ(run.name(), "discrete") << run.method().reason();
}

TEST(AutoMethod, whatWasCountedStaysCounted) {
  if (!canStep()) GTEST_SKIP() << "there is no stepping method";
  AutoRun run(stack(10, 0.01));
  Statistics before;
  for (int k = 1; k <= 300; ++k) {
    run.advanceTo(0.001 * k);
    const Statistics now = run.method().statistics();
    EXPECT_GE(now.events, before.events) << "at " << 0.001 * k << " s";
    EXPECT_GE(now.ball_collisions, before.ball_collisions) << "at " << 0.001 * k << " s";
    EXPECT_GE(now.deepest_overlap, before.deepest_overlap) << "at " << 0.001 * k << " s";
    before = now;
  }
  EXPECT_EQ(run.method().changes(), 1u);
}

TEST(AutoMethod, aFineToleranceShortensTheSteps) {
  if (!canStep()) GTEST_SKIP() << "there is no stepping method";
  Scene scene = stack(5, 0.01);
  scene.tolerance = 1e-4;  // g dt^2 <= 1e-4 * 0.05 m: 0.71 ms
  AutoRun run(scene);
  run.advanceTo(3);
  EXPECT_EQ(run.name(), "discrete");
  EXPECT_NE(run.method().reason().find("steps of 0.00071 s"), std::string::npos)
      << run.method().reason();
}

TEST(AutoMethod, elasticBallsUnderGravityStayExact) {
  Scene scene = stack(6, 0.02);
  scene.surroundings.restitution = 1;
  AutoRun run(scene);
  const double before = run.energy(scene.surroundings);
  run.advanceTo(3);
  EXPECT_EQ(run.name(), "event_driven");
  EXPECT_EQ(run.method().changes(), 0u);
  EXPECT_NEAR(run.energy(scene.surroundings) / before, 1, 1e-11);
}

// No stepping method takes impacts together: a flood is no reason to leave the one that does.
TEST(AutoMethod, keepsTheMethodThatTakesImpactsTogether) {
  Scene scene = stack(10, 0.01);
  AutoRun sequential(scene);
  sequential.advanceTo(0.2);
  ASSERT_EQ(sequential.name(), "discrete") << "the scene floods by then";
  scene.simultaneous_impacts = SimultaneousImpacts::simultaneous;
  AutoRun together(scene);
  together.advanceTo(0.2);
  EXPECT_EQ(together.name(), "event_driven");
  EXPECT_EQ(together.method().changes(), 0u);
}

TEST(AutoMethod, warnsOfOverlapBeyondTheTolerance) {
  Scene scene = gas(0);
  scene.fill.clear();
  scene.surroundings.box.min = Vector3::Zero();
  scene.surroundings.box.max = Vector3::Constant(10);
  scene.tolerance = 1e-4;
  scene.balls = {{Vector3(2, 5, 5), Vector3(1, 0, 0), 0.5, 1},
                 {Vector3(5, 5, 5), Vector3(-1, 0, 0), 0.5, 1}};
  AutoRun run(scene);
  run.advanceTo(1.5);
  EXPECT_EQ(run.method().statistics().ball_collisions, 1u);
  EXPECT_EQ(run.method().warning(), "");
  run.method().setMotion(0, Vector3(2, 5, 5), Vector3(1, 0, 0));
  run.method().setMotion(1, Vector3(2.9, 5, 5), Vector3(-1, 0, 0));  // 0.1 m into the other
  run.advanceTo(1.6);
  EXPECT_EQ(run.method().warning().find("balls overlapped by 0.1 m"), 0u) << run.method().warning();
}

// Its rounding stands in for a method that is wrong: no double keeps energy to 1e-17 of it.
TEST(AutoMethod, warnsOfEnergyThatDriftsBeyondTheTolerance) {
  Scene scene = gas(300);
  AutoRun usual(scene);
  usual.advanceTo(3);
  EXPECT_EQ(usual.method().warning(), "");
  for (BallId id = 0; id < 300; ++id) {
    usual.method().setVelocity(id, 2 * usual.method().ball(id).velocity);
  }
  usual.advanceTo(4);
  EXPECT_EQ(usual.method().warning(), "") << "that energy came from outside";
  scene.tolerance = 1e-17;
  AutoRun fine(scene);
  fine.advanceTo(3);
  EXPECT_NE(fine.method().warning().find("energy has drifted by"), std::string::npos)
      << fine.method().warning();
  EXPECT_EQ(fine.method().changes(), 0u);
  scene.surroundings.restitution = 0.9;
  AutoRun inelastic(scene);
  inelastic.advanceTo(3);
  EXPECT_EQ(inelastic.method().warning().find("energy"), std::string::npos) << "impacts take it";
}

// Bounces from rest: at first there is no kinetic energy to measure a drift by.
TEST(AutoMethod, energyMayFallAndRiseUnderGravity) {
  Scene scene = stack(40, 0.02);
  scene.surroundings.restitution = 1;
  AutoRun run(scene);
  run.advanceTo(5);
  EXPECT_GT(run.method().statistics().events, 10000u) << "looked at twice";
  EXPECT_EQ(run.method().warning(), "");
}

TEST(AutoMethod, takesChangesFromOutside) {
  AutoRun run(gas(50));
  run.advanceTo(0.5);
  run.method().remove(7);
  run.method().remove(49);
  run.method().setVelocity(3, Vector3(5, 0, 0));
  EXPECT_EQ(run.method().ball(3).velocity, Vector3(5, 0, 0));
  run.advanceTo(1);
  EXPECT_EQ(run.states().ids.size(), 48u);
  EXPECT_FALSE(run.method().findOverlap(run.method().ball(3).position, 0.01, BallId{3}));
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
