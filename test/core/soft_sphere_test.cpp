// Method soft_sphere: the closed forms of its spring, how its errors fall, and what it refuses.
#include "soft_sphere/soft_sphere.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "ball_sim/world.hpp"
#include "support/closed_form.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr double kContactTime = 0.01;  // s
const double kRound = double(kPi);

MethodSettings contacts(double contact_time, double steps_per_contact) {
  MethodSettings settings;
  settings.contact_time = contact_time;
  settings.time_step = contact_time / steps_per_contact;
  return settings;
}

constexpr double kTouch = 0.0625;  // s, when the two of headOn() touch

/// Ball 0 flies at 1 m/s into ball 1 at rest.
TestScene headOn(double restitution, double mass) {
  TestScene scene;
  scene.surroundings.restitution = restitution;
  scene.balls = {{Vector3(-1 - kTouch, 0, 0), Vector3(1, 0, 0), 0.5, 1},
                 {Vector3::Zero(), Vector3::Zero(), 0.5, mass}};
  return scene;
}

TEST(SoftSphere, AnImpactKeepsTheRestitutionAndLastsTheContactTime) {
  for (const double e : {1.0, 0.9, 0.5, 0.1}) {
    for (const double mass : {1.0, 7.0, 1e6}) {
      SCOPED_TRACE("e = " + std::to_string(e) + ", mass " + std::to_string(mass));
      const TestScene scene = headOn(e, mass);
      Trial run("soft_sphere", scene, contacts(kContactTime, 1000));
      run.advanceTo(2 * kTouch);
      const double parting = run.velocity(1).x() - run.velocity(0).x();
      // A contact found up to dt late: the dashpot then misses 2 b dt of the speed, 5e-3 at e =
      // 0.1.
      EXPECT_NEAR(parting, e, 6e-3 * (1 - e) + 1e-8);
      ASSERT_EQ(run.collisions().size(), 1u);
      const Collision& impact = run.collisions()[0];
      EXPECT_NEAR(impact.time.seconds() - kTouch, kContactTime, 2e-3 * kContactTime);  // 2 steps
      EXPECT_NEAR(impact.approach_speed, 1, 1e-2 * (1 - e) + 1e-4);
      EXPECT_NEAR(impact.impulse, (1 + e) / (1 + 1 / mass), 6e-3);
      EXPECT_NEAR(double(momentumOf(scene, run.states()).x()), 1, 1e-13 * mass);
      if (e == 1) {
        EXPECT_NEAR(run.method().statistics().deepest_overlap / (kContactTime / kRound), 1, 1e-5);
      }
    }
  }
}

TEST(SoftSphere, WallsAreAsSoftAsBalls) {
  TestScene scene;
  scene.surroundings.restitution = 0.5;
  scene.surroundings.planes = {{Vector3(0.6, 0.8, 0), -0.55}};
  scene.balls = {{Vector3::Zero(), Vector3(-0.6, -0.8, 0.25), 0.5, 3}};
  Trial run("soft_sphere", scene, contacts(kContactTime, 1000));
  run.advanceTo(0.1);
  EXPECT_NEAR(run.velocity(0).x(), 0.3, 2e-3);
  EXPECT_NEAR(run.velocity(0).y(), 0.4, 2e-3);
  EXPECT_EQ(run.velocity(0).z(), 0.25);
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_EQ(run.collisions()[0].b, planePartner(0));
  EXPECT_EQ(run.method().statistics().wall_collisions, 1u);
}

/// Worst relative change of energy of a head-on impact, over phases of the grid of steps.
double worstEnergyError(double steps_per_contact) {
  double worst = 0;
  constexpr int kPhases = 100;
  for (int i = 0; i < kPhases; ++i) {
    TestScene scene = headOn(1, 1);
    const double dt = kContactTime / steps_per_contact;
    scene.balls[0].position.x() = -1.01 - dt * i / kPhases;
    SoftSphere method(scene.surroundings, dt, kContactTime, 1);
    method.insert(0, scene.balls[0]);
    method.insert(1, scene.balls[1]);
    method.advanceTo(Time::fromSeconds(0.05));
    double energy = 0;
    for (const BallId id : {0u, 1u}) energy += method.ball(id).velocity.squaredNorm();
    worst = std::max(worst, std::abs(energy - 1));
  }
  return worst;
}

TEST(SoftSphere, TheEnergyErrorIsOfThirdOrder) {
  // Reference cases, row 14, two digits.
  EXPECT_NEAR(worstEnergyError(5), 1.7e-2, 0.05e-2);
  EXPECT_NEAR(worstEnergyError(10), 2.0e-3, 0.05e-3);
  EXPECT_NEAR(worstEnergyError(20), 2.5e-4, 0.05e-4);
  EXPECT_NEAR(worstEnergyError(50), 1.6e-5, 0.05e-5);
  // Slope 3; the next order is dt/t_c.
  EXPECT_NEAR(std::log2(worstEnergyError(50) / worstEnergyError(100)), 3, 0.03);
}

/// A ball that lies on the floor and is pushed a little: whether it is still there after 300 steps.
bool staysOnTheFloor(double steps_per_contact) {
  const Surroundings floor = floorUnderGravity(10, 1);
  const double dt = kContactTime / steps_per_contact;
  const double sag = 10 * std::pow(kContactTime / kRound, 2);  // g / omega^2
  SoftSphere method(floor, dt, kContactTime, 1);
  // Put in, a ball falls freely for its first step: this brings it back to where it began.
  const Vector3 velocity(0, 0, 10 * dt / 2 + 1e-3 * sag / kContactTime);
  method.insert(0, {Vector3(0, 0, 0.5 - sag), velocity, 0.5, 1});
  method.advanceTo(Time::fromSeconds(300 * dt));
  return std::abs(method.ball(0).position.z() - (0.5 - sag)) < 0.1 * sag;
}

TEST(SoftSphere, StepsBeyondTwoOverPiContactTimesAreUnstable) {
  EXPECT_TRUE(staysOnTheFloor(1 / 0.62));
  EXPECT_FALSE(staysOnTheFloor(1 / 0.65));
}

TEST(SoftSphere, StepsAboveATenthOfTheContactTimeAreRefused) {
  EXPECT_NO_THROW(makeMethod("soft_sphere", {}, contacts(1, 10)));
  EXPECT_NO_THROW(makeMethod("soft_sphere", {}, contacts(0.3, 10)));  // a tenth to rounding
  try {
    makeMethod("soft_sphere", {}, contacts(1, 5));
    FAIL() << "accepted";
  } catch (const std::invalid_argument& refused) {
    EXPECT_STREQ(refused.what(),
                 "time_step: 0.2: soft_sphere needs at most a tenth of the contact time, 0.1 s, to "
                 "keep the energy of an impact; without a time_step a scene gets one that fits");
  }
}

TEST(SoftSphere, TheTolerancesContactTimeKeepsOverlapsWithinIt) {
  // 2 m/s head-on at most, radius 0.05 m: pi 0.02 0.05 / 4 s.
  Scene scene;
  scene.method = "soft_sphere";
  scene.tolerance = 0.02;
  scene.balls = {{Vector3(-1, 0.02, 0), Vector3(2, 0, 0), 0.05, 1},
                 {Vector3(1, 0, 0), Vector3(-2, 0, 0), 0.05, 1}};
  const double contact_time = kRound * 0.02 * 0.05 / 4;
  const auto chosen = contactTimeFor(0.02, scene.balls, scene.surroundings);
  ASSERT_TRUE(chosen.has_value());
  EXPECT_NEAR(*chosen / contact_time, 1, 1e-15);
  scene.time_step = contact_time / 9;
  EXPECT_THROW(World{scene}, std::invalid_argument);
  scene.time_step = contact_time / 50;
  World world(scene);
  world.advanceTo(Time::fromSeconds(1));
  const double overlap = world.statistics().deepest_overlap / 0.05;
  EXPECT_LT(overlap, 0.02);
  EXPECT_GT(overlap, 0.018);  // askew, by cos(asin(0.2)) = 0.98
  EXPECT_EQ(world.warning(), "");
  world.setMotion(0, {-1, 0, 0}, {4, 0, 0});
  world.setMotion(1, {1, 0, 0}, {-4, 0, 0});
  world.advanceTo(Time::fromSeconds(2));
  const std::string warning = world.warning();
  EXPECT_NE(warning.find("more than the tolerance of 0.02"), std::string::npos) << warning;
}

/// A ball of 10 m/s in a closed box of 2 m.
Scene fastInABox() {
  Scene scene;
  scene.method = "soft_sphere";
  scene.surroundings.box = {Vector3::Zero(), Vector3::Constant(2)};
  scene.balls = {{Vector3::Constant(1), Vector3(10, 1, 0.3), 0.05, 1}};
  return scene;
}

TEST(SoftSphere, WithoutATimeStepASceneGetsOneThatFits) {
  for (const bool named : {false, true}) {
    Scene scene = fastInABox();
    if (named) scene.tolerance = 0.02;
    const double tolerance = named ? 0.02 : 0.1;
    World world(scene);
    world.advanceTo(Time::fromSeconds(1));
    const double overlap = world.statistics().deepest_overlap / 0.05;
    EXPECT_LT(overlap, tolerance) << "made for two of it, head-on";
    EXPECT_GT(overlap, 0.4 * tolerance) << "a wall: half of that";
    EXPECT_EQ(world.warning(), "");
    EXPECT_GE(world.ball(0).position.x(), 0.045);
    EXPECT_LE(world.ball(0).position.x(), 1.955);
  }
}

TEST(SoftSphere, SaysThatBallsWentThroughAWall) {
  Scene scene = fastInABox();
  scene.time_step = 1e-3;  // contacts of 50 ms, in which the ball flies half a metre
  World world(scene);
  world.advanceTo(Time::fromSeconds(0.112));
  EXPECT_LT(1.95, world.ball(0).position.x());
  EXPECT_NE(world.warning().find("went through walls"), std::string::npos) << world.warning();
}

TEST(SoftSphere, WarnsOfBallsThatPassedUnseen) {
  Scene scene = fastInABox();
  scene.balls[0].velocity = Vector3(10, 0, 0);
  scene.balls[0].position.x() = 0.2;
  scene.balls.push_back({Vector3(0.5, 1, 1), Vector3::Zero(), 0.05, 1});
  scene.time_step = 0.04;  // 0.4 m: over the other ball at once
  World world(scene);
  EXPECT_EQ(world.warning(), "");
  world.advanceTo(Time::fromSeconds(0.1));
  EXPECT_EQ(world.statistics().ball_collisions, 0u);
  const std::string warning = world.warning();
  EXPECT_NE(warning.find("moved by 8 of its radius"), std::string::npos) << warning;
  EXPECT_NE(warning.find("unseen"), std::string::npos) << warning;
}

TEST(SoftSphere, TheContactTimeKnowsOfFallsAndOfStillness) {
  Surroundings floor = floorUnderGravity(10, 1);
  const std::vector<Ball> ball = {{Vector3(0, 0, 5.1), Vector3::Zero(), 0.1, 1}};
  // 5 m down: 10 m/s, and two such balls head-on.
  EXPECT_NEAR(*contactTimeFor(0.1, ball, floor), kRound * 0.1 * 0.1 / 20, 1e-15);
  floor.gravity = Vector3::Zero();
  EXPECT_FALSE(contactTimeFor(0.1, ball, floor).has_value());
}

TEST(SoftSphere, EnergyInTheSpringsIsCounted) {
  Trial run("soft_sphere", headOn(1, 1), contacts(kContactTime, 100));
  run.advanceTo(kTouch + kContactTime / 2);  // deepest: half of the energy is in the spring
  EXPECT_NEAR(run.method().statistics().elastic_energy, 0.25, 1e-3);
  EXPECT_NEAR(double(kineticEnergyOf(headOn(1, 1), run.states())), 0.25, 1e-3);
  run.advanceTo(2 * kTouch);
  EXPECT_EQ(run.method().statistics().elastic_energy, 0);
}

TEST(SoftSphere, ABallRestsWhereTheSpringBearsIt) {
  TestScene scene{floorUnderGravity(10, 0.3), {{Vector3(0, 0, 0.6), Vector3::Zero(), 0.5, 2}}};
  Trial run("soft_sphere", scene, contacts(kContactTime, 50));
  run.advanceTo(10);
  const ContactSpring spring = contactSpring(kContactTime, 0.3);
  EXPECT_NEAR((0.5 - run.position(0).z()) * spring.stiffness, 10, 1e-9);
  EXPECT_LT(run.velocity(0).norm(), 1e-12);
}

TEST(SoftSphere, AGasKeepsItsEnergyWithinItsImpactsErrors) {
  for (const char* name : {"closed_3d", "periodic_3d", "closed_2d_gravity"}) {
    for (const SceneKind& kind : sceneKinds()) {
      if (kind.name != name) continue;
      const TestScene scene = randomScene(kind, 4);
      Trial run("soft_sphere", scene, contacts(2e-3, 20));
      const auto energy = [&] {
        double sum =
            double(kineticEnergyOf(scene, run.states())) + run.method().statistics().elastic_energy;
        for (BallId id = 0; id < scene.balls.size(); ++id) {
          sum -= scene.balls[id].mass * dot(scene.surroundings.gravity, run.position(id));
        }
        return sum;
      };
      const double before = energy();
      run.advanceTo(2);
      EXPECT_GT(run.collisions().size(), 30u);
      // Each of some 50 impacts errs by up to 2.5e-4 of two balls' share, at random signs.
      EXPECT_NEAR(energy() / before, 1, 1e-3) << name;
      EXPECT_NE(energy(), before);
    }
  }
}

TEST(SoftSphere, TheStateDoesNotDependOnWhereOneStops) {
  SceneKind kind;
  kind.gravity = 5;
  kind.restitution = 0.7;
  const TestScene scene = randomScene(kind, 3);
  Trial straight("soft_sphere", scene, contacts(0.01, 50));
  Trial halting("soft_sphere", scene, contacts(0.01, 50));
  straight.advanceTo(1.2345);
  for (double t = 0.0037; t < 1.2345; t += 0.0037) {
    while (!halting.method().advanceTo(Time::fromSeconds(t), 3)) halting.states();
    halting.states();
  }
  halting.advanceTo(1.2345);
  EXPECT_EQ(straight.states().positions, halting.states().positions);
  EXPECT_EQ(straight.states().velocities, halting.states().velocities);
}

TEST(SoftSphere, GoesToTheHardBallsAsContactsShorten) {
  double before = 0;
  for (const double contact_time : {0.04, 0.02, 0.01}) {
    TestScene scene = headOn(1, 2);
    scene.balls[0].position.y() = 0.3;
    Trial run("soft_sphere", scene, contacts(contact_time, 50));
    Trial truth("event_driven", scene);
    run.advanceTo(3);
    truth.advanceTo(3);
    const double error = (run.position(0) - truth.position(0)).norm();
    // Order 1 in t_c: late by a part of the contact, and turned a little while it lasts.
    if (before > 0) {
      EXPECT_NEAR(std::log2(before / error), 1, 0.1) << contact_time;
    }
    before = error;
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
