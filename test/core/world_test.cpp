// World: what it lets in, what it refuses and why, and that a refusal changes nothing.
#include "ball_sim/world.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "ball_sim/observables.hpp"

namespace ball_sim::core {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
const double kNan = std::numeric_limits<double>::quiet_NaN();

// A closed box 2 m wide around the origin with one ball at rest in the middle.
Scene oneBallInABox() {
  Scene scene;
  scene.surroundings.box = {Vector3::Constant(-1), Vector3::Constant(1)};
  scene.balls = {{Vector3::Zero(), Vector3::Zero(), 0.1, 2.0}};
  return scene;
}

Ball ballAt(double x, double y, double z, double radius = 0.1, double mass = 1) {
  return {{x, y, z}, Vector3::Zero(), radius, mass};
}

std::uint64_t hashOf(const World& world) {
  BallStates states;
  world.read(states);
  return stateHash(states);
}

// The reason a ball is refused with `code`; the world must stay as it was.
std::string reasonFor(World& world, const Ball& ball, RefusalCode code) {
  const std::uint64_t before = hashOf(world);
  const std::size_t size = world.size();
  try {
    world.spawn(ball);
  } catch (const Refused& refused) {
    EXPECT_EQ(refused.code(), code) << refused.what();
    EXPECT_EQ(hashOf(world), before);
    EXPECT_EQ(world.size(), size);
    return refused.what();
  }
  ADD_FAILURE() << "accepted";
  return "";
}

TEST(World, RefusesWhatIsNotAFiniteBall) {
  World world(oneBallInABox());
  const auto with = [](auto change) {
    Ball ball = ballAt(0.5, 0, 0);
    change(ball);
    return ball;
  };
  for (const double bad : {kNan, kInf, -kInf}) {
    reasonFor(world, with([&](Ball& b) { b.position.y() = bad; }), RefusalCode::not_finite);
    reasonFor(world, with([&](Ball& b) { b.velocity.z() = bad; }), RefusalCode::not_finite);
    reasonFor(world, with([&](Ball& b) { b.radius = bad; }), RefusalCode::not_finite);
  }
  reasonFor(world, with([](Ball& b) { b.mass = kNan; }), RefusalCode::not_finite);
  reasonFor(world, with([](Ball& b) { b.mass = -kInf; }), RefusalCode::not_finite);
  for (const double bad : {0.0, -0.1, 5e-324, 1e-300, 1e200}) {
    reasonFor(world, with([&](Ball& b) { b.radius = bad; }), RefusalCode::out_of_range);
    reasonFor(world, with([&](Ball& b) { b.mass = bad; }), RefusalCode::out_of_range);
  }
  reasonFor(world, with([](Ball& b) { b.position.x() = 1e200; }), RefusalCode::out_of_range);
  reasonFor(world, with([](Ball& b) { b.velocity.x() = 1e200; }), RefusalCode::out_of_range);
}

TEST(World, RefusalsNameThingValueAndRule) {
  World world(oneBallInABox());
  EXPECT_EQ(reasonFor(world, ballAt(0.5, 0, 0, -0.25), RefusalCode::out_of_range),
            "radius is -0.25 m: must be above 0");
  EXPECT_EQ(reasonFor(world, ballAt(0.125, 0, 0), RefusalCode::overlap),
            "ball overlaps ball 0: centres 0.125 m apart, radii sum to 0.2 m");
  EXPECT_EQ(reasonFor(world, ballAt(0, 0, 0), RefusalCode::overlap),
            "ball overlaps ball 0: centres 0 m apart, radii sum to 0.2 m");
  EXPECT_NE(reasonFor(world, ballAt(1.25, 0, 0, 0.25), RefusalCode::outside)
                .find("sticks out 0.5 m beyond the box's x-max face, x = 1"),
            std::string::npos);
}

TEST(World, TouchingIsAllowed) {
  World world(oneBallInABox());
  EXPECT_NO_THROW(world.spawn(ballAt(0.2, 0, 0)));
  // Inside the slack of 1e-12 of a radius, and of a sum of radii.
  EXPECT_NO_THROW(world.spawn(ballAt(0.9 + 5e-14, 0, 0)));
  EXPECT_NO_THROW(world.spawn(ballAt(-0.2 * (1 - 5e-13), 0, 0)));
  // Ten times beyond it.
  reasonFor(world, ballAt(0, 0.9 + 1e-12, 0), RefusalCode::outside);
  reasonFor(world, ballAt(0, -0.2 * (1 - 1e-11), 0), RefusalCode::overlap);
}

TEST(World, ChecksPlanes) {
  Scene scene;
  scene.surroundings.planes = {{Vector3(0, 0.6, 0.8), -1}, {Vector3::UnitX(), 0}};
  World world(scene);
  EXPECT_NO_THROW(world.spawn(ballAt(1, 0, 0)));
  EXPECT_NE(reasonFor(world, ballAt(0.05, 5, 5), RefusalCode::outside).find("plane 1"),
            std::string::npos);
  EXPECT_NE(reasonFor(world, ballAt(5, -1.6, 0), RefusalCode::outside).find("plane 0"),
            std::string::npos);
}

TEST(World, PlanarScenesStayPlanar) {
  Scene scene = oneBallInABox();
  scene.surroundings.box.min.z() = scene.surroundings.box.max.z() = 0;
  World world(scene);
  reasonFor(world, ballAt(0.5, 0, 1e-300), RefusalCode::not_planar);
  Ball climbing = ballAt(0.5, 0, 0);
  climbing.velocity.z() = 1e-300;
  reasonFor(world, climbing, RefusalCode::not_planar);
  EXPECT_THROW(world.applyImpulse(0, {1, 0, 1e-300}), Refused);
  EXPECT_THROW(world.setMotion(0, {0, 0, 1}, Vector3::Zero()), Refused);
  // The z faces do not exist for them: a ball of any radius fits.
  EXPECT_NO_THROW(world.spawn(ballAt(0.5, 0, 0)));
}

TEST(World, FixedBallsStayPut) {
  Scene scene = oneBallInABox();
  scene.balls[0].mass = kInf;
  World world(scene);
  EXPECT_THROW(world.applyImpulse(0, {1, 0, 0}), Refused);
  EXPECT_THROW(world.setMotion(0, {0.5, 0, 0}, Vector3::Zero()), Refused);
  Ball moving = ballAt(0.5, 0, 0, 0.1, kInf);
  moving.velocity.x() = 1;
  reasonFor(world, moving, RefusalCode::fixed_ball);
  EXPECT_EQ(world.kineticEnergy(), 0);
  EXPECT_EQ(world.momentum(), Vector3(0, 0, 0));
}

TEST(World, SpawnsAllOrNone) {
  World world(oneBallInABox());
  const SpawnResult refused = world.spawn(
      {ballAt(0.5, 0, 0), ballAt(0.05, 0, 0), ballAt(0.5, 0.1, 0), ballAt(0.5, 0, 0.5)});
  EXPECT_FALSE(refused.accepted());
  ASSERT_EQ(refused.refusals.size(), 4u);
  EXPECT_EQ(refused.refusals[0].code, RefusalCode::rejected_with_others);
  EXPECT_EQ(refused.refusals[1].code, RefusalCode::overlap);
  EXPECT_EQ(refused.refusals[2].code, RefusalCode::overlap);
  EXPECT_NE(refused.refusals[2].reason.find("ball number 0 of the same request"),
            std::string::npos);
  EXPECT_EQ(world.size(), 1u);

  const SpawnResult accepted = world.spawn({ballAt(0.5, 0, 0), ballAt(0.5, 0, 0.5)});
  EXPECT_TRUE(accepted.accepted());
  EXPECT_EQ(accepted.ids, (std::vector<BallId>{1, 2}));
  EXPECT_EQ(world.ids(), (std::vector<BallId>{0, 1, 2}));
  EXPECT_TRUE(world.spawn(std::vector<Ball>{}).accepted());
}

TEST(World, KeepsTheBallLimit) {
  WorldOptions options;
  options.max_balls = 2;
  World world(oneBallInABox(), options);
  const SpawnResult refused = world.spawn({ballAt(0.5, 0, 0), ballAt(0, 0.5, 0)});
  ASSERT_EQ(refused.refusals.size(), 2u);
  EXPECT_EQ(refused.refusals[1].code, RefusalCode::ball_limit);
  EXPECT_NO_THROW(world.spawn(ballAt(0.5, 0, 0)));
  reasonFor(world, ballAt(0, 0.5, 0), RefusalCode::ball_limit);
  options.max_balls = 0;
  EXPECT_THROW(World(oneBallInABox(), options), Refused);
}

TEST(World, NamesABadBallOfTheSceneByIndex) {
  Scene scene = oneBallInABox();
  scene.balls.push_back(ballAt(0.5, 0, 0));
  scene.balls.push_back(ballAt(0.5, 0.05, 0, 0.2));
  try {
    const World world(scene);
    FAIL();
  } catch (const Refused& refused) {
    EXPECT_EQ(refused.code(), RefusalCode::overlap);
    const std::string reason = refused.what();
    EXPECT_NE(reason.find("balls[1]"), std::string::npos) << reason;
    EXPECT_NE(reason.find("balls[2]"), std::string::npos) << reason;
  }
}

TEST(World, RemovesAllOrNone) {
  World world(oneBallInABox());
  world.spawn({ballAt(0.5, 0, 0), ballAt(0, 0.5, 0)});
  try {
    world.remove({0, 9, 1, 7});
    FAIL();
  } catch (const Refused& refused) {
    EXPECT_EQ(refused.code(), RefusalCode::unknown_ball);
    EXPECT_STREQ(refused.what(), "no balls have the ids 7, 9");
  }
  EXPECT_EQ(world.size(), 3u);
  world.remove({1, 1});
  EXPECT_EQ(world.ids(), (std::vector<BallId>{0, 2}));
  EXPECT_FALSE(world.contains(1));
  EXPECT_THROW(world.ball(1), Refused);
  EXPECT_EQ(world.spawn(ballAt(0.5, 0, 0)), 3u) << "an id is never used twice";
  world.removeSpawned();
  EXPECT_EQ(world.ids(), (std::vector<BallId>{0}));
  world.removeAll();
  EXPECT_EQ(world.size(), 0u);
}

TEST(World, AppliesImpulses) {
  World world(oneBallInABox());
  const World::VelocityChange change = world.applyImpulse(0, {1, 0, -4});
  EXPECT_EQ(change.before, Vector3(0, 0, 0));
  EXPECT_EQ(change.after, Vector3(0.5, 0, -2));  // J/m with m = 2 kg
  EXPECT_EQ(world.ball(0).velocity, Vector3(0.5, 0, -2));
  EXPECT_EQ(world.momentum(), Vector3(1, 0, -4));
  EXPECT_EQ(world.kineticEnergy(), 4.25);
  EXPECT_THROW(world.applyImpulse(0, {kNan, 0, 0}), Refused);
  EXPECT_THROW(world.applyImpulse(0, {1e300, 0, 0}), Refused);
  EXPECT_THROW(world.applyImpulse(5, {1, 0, 0}), Refused);
  EXPECT_EQ(world.ball(0).velocity, Vector3(0.5, 0, -2));
}

TEST(World, SetsMotionCheckedAsForSpawn) {
  World world(oneBallInABox());
  world.spawn(ballAt(0.5, 0, 0));
  EXPECT_THROW(world.setMotion(0, {0.45, 0, 0}, Vector3::Zero()), Refused);
  EXPECT_THROW(world.setMotion(0, {0.95, 0, 0}, Vector3::Zero()), Refused);
  EXPECT_THROW(world.setMotion(0, {0, 0, 0}, Vector3(kNan, 0, 0)), Refused);
  world.setMotion(0, {0.05, 0, 0}, {0, 1, 0});  // into its own old place: no overlap with itself
  EXPECT_EQ(world.ball(0).position, Vector3(0.05, 0, 0));
  EXPECT_EQ(world.ball(0).velocity, Vector3(0, 1, 0));
}

TEST(World, WrapsPeriodicPlaces) {
  Scene scene = oneBallInABox();
  scene.surroundings.periodic = true;
  World world(scene);
  const BallId id = world.spawn(ballAt(2.5, -3.75, 1));
  EXPECT_EQ(world.ball(id).position, Vector3(0.5, 0.25, -1));
  // Through the face: 0.1 m from the image of the ball just spawned.
  EXPECT_EQ(reasonFor(world, ballAt(0.5, 0.25, 0.9), RefusalCode::overlap),
            "ball overlaps ball 1: centres 0.1 m apart, radii sum to 0.2 m");
  reasonFor(world, ballAt(0, 0, 0, 1.5), RefusalCode::outside);
}

TEST(World, OneBallInABoxFollowsTheFold) {
  Scene scene = oneBallInABox();
  scene.balls[0] = {{0.2, -0.3, 0.5}, {1.7, -2.3, 0.9}, 0.1, 2.0};
  World world(scene);
  const double t = 12.75;
  EXPECT_TRUE(world.advanceTo(Time::fromSeconds(t)));
  for (int axis = 0; axis < 3; ++axis) {
    // The centre moves in [-0.9, 0.9]: a straight line, folded.
    const double u = scene.balls[0].position[axis] + scene.balls[0].velocity[axis] * t + 0.9;
    const double phase = u - 3.6 * std::floor(u / 3.6);
    const double expected = (phase < 1.8 ? phase : 3.6 - phase) - 0.9;
    // Some 15 bounces, each rounding to an ulp of 1, times the speed.
    EXPECT_NEAR(world.ball(0).position[axis], expected, 1e-13);
  }
  EXPECT_THROW(world.advanceTo(Time::fromSeconds(1)), std::invalid_argument);
}

TEST(World, StopsEarlyAndGoesOn) {
  Scene scene = oneBallInABox();
  scene.balls[0].velocity.x() = 1;
  World whole(scene);
  World pieces(scene);
  EXPECT_TRUE(whole.advanceTo(Time::fromSeconds(20)));
  int calls = 1;
  while (!pieces.advanceTo(Time::fromSeconds(20), 1)) ++calls;
  EXPECT_GT(calls, 10);  // a bounce every 1.8 s
  EXPECT_EQ(hashOf(pieces), hashOf(whole));
}

TEST(World, ResetBringsTheSceneBack) {
  Scene scene = oneBallInABox();
  scene.balls[0].velocity.x() = 1;
  World world(scene);
  CollisionLog log;
  world.setCollisionLog(&log);
  const std::uint64_t start = hashOf(world);
  world.advanceTo(Time::fromSeconds(5));
  EXPECT_FALSE(log.entries.empty());
  world.spawn(ballAt(0, 0.5, 0));
  world.remove({0});

  world.reset(false);
  EXPECT_EQ(hashOf(world), start);
  EXPECT_EQ(world.now(), Time::fromSeconds(5));
  EXPECT_EQ(world.statistics().wall_collisions, 0u);
  log.entries.clear();
  world.advanceTo(Time::fromSeconds(10));
  EXPECT_FALSE(log.entries.empty()) << "the log goes on across resets";
  EXPECT_EQ(world.spawn(ballAt(0, 0.5, 0)), 2u) << "no id twice while time goes on";

  world.reset(true);
  EXPECT_EQ(hashOf(world), start);
  EXPECT_EQ(world.now(), Time());
  EXPECT_EQ(world.spawn(ballAt(0, 0.5, 0)), 1u) << "a new run";
}

TEST(World, RefusesUnknownMethodsAndTimeSteps) {
  WorldOptions options;
  options.method = "newton";
  try {
    const World world(oneBallInABox(), options);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("event_driven"), std::string::npos) << error.what();
  }
  options = {};
  options.time_step = 0;
  EXPECT_THROW(World(oneBallInABox(), options), std::invalid_argument);
}

TEST(World, TakesAToleranceInPlaceOfTheScenes) {
  Scene scene = oneBallInABox();
  EXPECT_FALSE(World(scene).scene().tolerance);
  scene.tolerance = 0.5;
  WorldOptions options;
  EXPECT_EQ(World(scene, options).scene().tolerance, 0.5);
  options.tolerance = 0.01;
  EXPECT_EQ(World(scene, options).scene().tolerance, 0.01);
  for (const double bad : {0.0, -1.0, 1.1, std::nan("")}) {
    options.tolerance = bad;
    try {
      const World world(scene, options);
      FAIL() << bad;
    } catch (const std::invalid_argument& error) {
      EXPECT_EQ(std::string(error.what()).find("tolerance: "), 0u) << error.what();
    }
  }
}

}  // namespace
}  // namespace ball_sim::core
