// Method discrete: what it keeps exactly, how its error falls with the step, and its grid of dates.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "support/closed_form.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

Trial discrete(const TestScene& scene, double time_step) {
  return Trial("discrete", scene, stepsOf(time_step));
}

SceneKind kindNamed(const std::string& name) {
  for (const SceneKind& kind : sceneKinds()) {
    if (kind.name == name) return kind;
  }
  ADD_FAILURE() << name;
  return {};
}

TEST(Discrete, AnElasticGasKeepsEnergyAndMomentumAtAnyStep) {
  for (const char* name : {"closed_3d_dense", "closed_2d_ratio_10", "closed_3d_fixed", "planes_3d",
                           "periodic_3d_ratio_10", "periodic_2d"}) {
    const SceneKind kind = kindNamed(name);
    const TestScene scene = randomScene(kind, 1);
    const Trial start = discrete(scene, 1);
    for (const double dt : {1e-3, 1.0 / 60, 0.3}) {
      Trial run = discrete(scene, dt);
      run.advanceTo(3);
      EXPECT_GT(run.collisions().size(), 5u);
      const long double before = kineticEnergyOf(scene, start.states());
      // Thousands of impacts round it by an ulp each, at random.
      EXPECT_NEAR(double(kineticEnergyOf(scene, run.states()) / before), 1, 1e-13) << name << dt;
      if (kind.boundary != Boundary::periodic) continue;
      const VectorOf<long double> gained =
          momentumOf(scene, run.states()) - momentumOf(scene, start.states());
      EXPECT_LT(double(gained.norm()), 1e-12 * std::sqrt(double(before))) << name << dt;
    }
  }
}

TEST(Discrete, AnElasticBallUnderGravityKeepsItsEnergy) {
  TestScene scene{floorUnderGravity(9.81, 1), {{Vector3(0, 0, 1.1), Vector3(0.3, 0, 0), 0.1, 1}}};
  Trial run = discrete(scene, 1e-3);
  run.advanceTo(634);  // 702 bounces, see stability_test.cpp
  EXPECT_NEAR(double(run.collisions().size()), 702, 2);
  const double energy = 9.81 * run.position(0).z() + run.velocity(0).squaredNorm() / 2;
  // 634000 steps round it by an ulp each, at random 1e-13. Euler's steps would gain g^2 dt / 2 a
  // second: 30 J of 11.
  EXPECT_NEAR(energy / (9.81 * 1.1 + 0.045), 1, 1e-12);
}

TEST(Discrete, FlightIsTheExactParabola) {
  TestScene scene;
  scene.surroundings.gravity = Vector3(1, -2, -10);
  scene.balls = {{Vector3(1, 2, 3), Vector3(4, 5, 6), 0.1, 1}};
  for (const double e : {1.0, 0.5}) {  // the two ways to step
    scene.surroundings.restitution = e;
    Trial run = discrete(scene, 0.125);
    for (const double t : {0.0625, 0.25, 0.3, 7.77}) {
      run.advanceTo(t);
      const Vector3 place = Vector3(1, 2, 3) + t * (Vector3(4, 5, 6) + t / 2 * Vector3(1, -2, -10));
      EXPECT_LT((run.position(0) - place).norm(), 1e-12) << t;  // 300 m, a few ulps
      EXPECT_LT((run.velocity(0) - Vector3(4 + t, 5 - 2 * t, 6 - 10 * t)).norm(), 1e-13) << t;
    }
  }
}

// Two balls meet askew; the error against the exact place, over many phases of the grid.
double meanError(double dt) {
  double sum = 0;
  constexpr int kPhases = 64;
  for (int i = 0; i < kPhases; ++i) {
    TestScene scene;
    const double start = -3 - dt * (i + 0.5) / kPhases;
    scene.balls = {{Vector3(start, 0.2, 0.1), Vector3(1, 0, 0), 0.5, 1},
                   {Vector3::Zero(), Vector3::Zero(), 0.5, 2}};
    Trial run = discrete(scene, dt);
    Trial truth("event_driven", scene);
    run.advanceTo(6);
    truth.advanceTo(6);
    sum += (run.position(0) - truth.position(0)).norm();
  }
  return sum / kPhases;
}

TEST(Discrete, TheErrorFallsAsTheTimeStep) {
  double coarse = meanError(0.08);
  for (const double dt : {0.04, 0.02, 0.01}) {
    const double fine = meanError(dt);
    // Order 1; a mean of 64 phases leaves the next order, dt/R, a tenth here.
    EXPECT_NEAR(std::log2(coarse / fine), 1, 0.15) << dt;
    coarse = fine;
  }
}

TEST(Discrete, TouchingBallsPassAnImpulseOn) {
  TestScene scene;
  for (int i = 0; i < 5; ++i) scene.balls.push_back({Vector3(i, 0, 0), Vector3::Zero(), 0.5, 1});
  scene.balls[0] = {Vector3(-1, 0, 0), Vector3(1, 0, 0), 0.5, 1};
  Trial run = discrete(scene, 0.0625);
  run.advanceTo(3);
  for (BallId id = 0; id < 4; ++id) EXPECT_EQ(run.velocity(id), Vector3(0, 0, 0)) << id;
  EXPECT_EQ(run.velocity(4), Vector3(1, 0, 0));
}

TEST(Discrete, NoImpulseUnlessTheyApproach) {
  TestScene scene;
  scene.balls = {{Vector3::Zero(), Vector3(-0.01, 1, 0), 0.5, 1},
                 {Vector3(0.3, 0, 0), Vector3(0.01, 1, 0), 0.5, 1}};
  Trial run = discrete(scene, 0.01);  // they overlap for 35 s, and part
  run.advanceTo(50);
  EXPECT_TRUE(run.collisions().empty());
  EXPECT_EQ(run.velocity(0), Vector3(-0.01, 1, 0));

  scene.balls[0].velocity.x() = 0.01;
  scene.balls[1].velocity.x() = -0.01;
  Trial meeting = discrete(scene, 0.01);
  meeting.advanceTo(50);
  EXPECT_EQ(meeting.collisions().size(), 1u);  // one, and no second while they still overlap
  EXPECT_EQ(meeting.velocity(0), Vector3(-0.01, 1, 0));
}

TEST(Discrete, RestitutionIsThatOfTheScene) {
  for (const double e : {0.9, 0.5, 0.0}) {
    TestScene scene;
    scene.surroundings.restitution = e;
    scene.surroundings.box.max.x() = 1;
    scene.balls = {{Vector3(-3, 0, 0), Vector3(1, 0, 0), 0.5, 1}};
    Trial wall = discrete(scene, 0.01);
    wall.advanceTo(5);
    EXPECT_DOUBLE_EQ(wall.velocity(0).x(), -e);
    scene.surroundings.box.max.x() = 1e9;
    scene.balls.push_back({Vector3::Zero(), Vector3::Zero(), 0.5, 3});
    Trial pair = discrete(scene, 0.01);
    pair.advanceTo(5);
    EXPECT_NEAR(pair.velocity(1).x(), (1 + e) / 4, 1e-15);
    EXPECT_NEAR(pair.velocity(0).x(), 1 - 3 * (1 + e) / 4, 1e-15);
  }
}

TEST(Discrete, TheStateDoesNotDependOnWhereOneStops) {
  for (const char* name : {"closed_3d_gravity_inelastic", "periodic_3d", "planes_2d"}) {
    const TestScene scene = randomScene(kindNamed(name), 3);
    Trial straight = discrete(scene, 0.01);
    Trial halting = discrete(scene, 0.01);
    straight.advanceTo(1.2345);
    for (double t = 0.0037; t < 1.2345; t += 0.0037) {
      while (!halting.method().advanceTo(Time::fromSeconds(t), 3)) halting.states();
      halting.states();
      halting.method().findOverlap(Vector3::Zero(), 0.1, std::nullopt);
    }
    halting.advanceTo(1.2345);
    EXPECT_EQ(straight.states().positions, halting.states().positions) << name;
    EXPECT_EQ(straight.states().velocities, halting.states().velocities) << name;
  }
}

TEST(Discrete, StepsAreDueOnTheirDates) {
  TestScene scene;  // a wall that the third step of 0.1 s finds; 3 * 0.1 is above 0.3
  scene.surroundings.box.max.x() = 0;
  scene.balls = {{Vector3(-0.75, 0, 0), Vector3(1, 0, 0), 0.5, 1}};
  Trial run = discrete(scene, 0.1);
  run.advanceTo(0.29999);
  EXPECT_EQ(run.velocity(0).x(), 1);
  run.advanceTo(0.3);
  EXPECT_EQ(run.velocity(0).x(), -1);
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_NEAR(run.collisions()[0].time.seconds(), 0.3, 1e-15);
}

TEST(Discrete, ChangesBetweenStepsActFromTheirDateOn) {
  TestScene scene;
  scene.surroundings.gravity = Vector3(0, 0, -10);
  scene.balls = {{Vector3::Zero(), Vector3(1, 0, 0), 0.1, 1}};
  Trial run = discrete(scene, 0.1);
  run.advanceTo(0.13);
  const Vector3 place = run.position(0);
  run.method().setVelocity(0, Vector3(0, 2, 0));
  EXPECT_LT((run.position(0) - place).norm(), 1e-15);
  run.method().insert(4, {Vector3(5, 5, 5), Vector3(0, 0, 3), 0.1, 1});
  EXPECT_LT((run.position(4) - Vector3(5, 5, 5)).norm(), 2e-15);
  EXPECT_LT((run.velocity(4) - Vector3(0, 0, 3)).norm(), 1e-15);
  run.advanceTo(0.13 + 0.5);
  EXPECT_LT((run.position(0) - (place + Vector3(0, 1, -1.25))).norm(), 1e-14);
  EXPECT_LT((run.position(4) - Vector3(5, 5, 5 + 1.5 - 1.25)).norm(), 1e-14);
  run.method().setMotion(0, Vector3(7, 0, 0), Vector3(1, 0, 0));
  EXPECT_LT((run.position(0) - Vector3(7, 0, 0)).norm(), 2e-15);
  run.method().remove(4);
  run.advanceTo(1.63);
  EXPECT_LT((run.position(0) - Vector3(8, 0, -5)).norm(), 1e-13);
  EXPECT_EQ(run.states().ids, std::vector<BallId>{0});
}

TEST(Discrete, AnEmptyMethodKeepsTimeWithoutSteps) {
  Trial run = discrete(TestScene{}, 1e-3);
  run.advanceTo(1e12, 0);
  EXPECT_EQ(run.method().now(), Time::fromSeconds(1e12));
  run.method().insert(0, {Vector3::Zero(), Vector3(2, 0, 0), 0.5, 1});
  run.advanceTo(1e12 + 1);
  EXPECT_NEAR(run.position(0).x(), 2, 1e-12);
}

TEST(Discrete, PlanarScenesStayPlanar) {
  const TestScene scene = randomScene(kindNamed("closed_2d_gravity_inelastic"), 2);
  Trial run = discrete(scene, 0.01);
  run.advanceTo(5);
  for (const Vector3& x : run.states().positions) EXPECT_EQ(x.z(), 0);
}

TEST(Discrete, RefusesStepsThatAreNone) {
  for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    EXPECT_THROW(makeMethod("discrete", {}, stepsOf(bad)), std::invalid_argument);
  }
  try {
    makeMethod("discrete", {}, stepsOf(-0.5));
  } catch (const std::invalid_argument& refused) {
    EXPECT_STREQ(refused.what(), "time_step: -0.5: must be a finite number of seconds above 0");
  }
}

TEST(Discrete, WarnsOfBallsThatMoveTooFarInAStep) {
  TestScene scene;
  scene.balls = {{Vector3::Zero(), Vector3(4.9, 0, 0), 0.1, 1}};
  Trial slow = discrete(scene, 0.01);
  slow.advanceTo(1);
  EXPECT_EQ(slow.method().warning(), "");
  slow.method().setVelocity(0, Vector3(6, 0, 0));
  slow.advanceTo(2);
  const std::string warning = slow.method().warning();
  EXPECT_NE(warning.find("moved by 0.6 of its radius"), std::string::npos) << warning;
  EXPECT_NE(warning.find("time_step of 0.01 s"), std::string::npos) << warning;
}

/// Two balls of radius 0.1 m on each other on the floor, g = 10 m/s^2; sqrt(r/g) = 0.1 s.
std::string warningOfAStack(double time_step, double restitution) {
  TestScene scene{floorUnderGravity(10, restitution), {}};
  for (const double z : {0.1, 0.3}) {
    scene.balls.push_back({Vector3(0, 0, z), Vector3::Zero(), 0.1, 1});
  }
  Trial run = discrete(scene, time_step);
  run.advanceTo(0.5);
  return run.method().warning();
}

TEST(Discrete, WarnsOfStepsThatAreTooLongForAPile) {
  EXPECT_EQ(warningOfAStack(0.0049, 0.5), "");
  const std::string warning = warningOfAStack(0.0051, 0.5);
  EXPECT_NE(warning.find("balls of radius 0.1 m that lie on others come to rest late"),
            std::string::npos)
      << warning;
  EXPECT_NE(warning.find("take one of 0.005 s or less"), std::string::npos) << warning;
  EXPECT_EQ(warningOfAStack(0.0051, 1), "") << "nothing rests";
  TestScene scene{floorUnderGravity(10, 0.5), {{Vector3(0, 0, 0.1), Vector3::Zero(), 0.1, 1}}};
  Trial alone = discrete(scene, 0.0051);
  alone.advanceTo(0.5);
  EXPECT_EQ(alone.method().warning(), "") << "one ball on the floor is no pile";
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
