// Where the stepping methods fail, and that they fail just there: the rows of the table of
// stability cases that exact methods hold (stability_test.cpp) and these do not, or only so far.
// What the border keeps out is kept out whatever the method.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "ball_sim/world.hpp"
#include "support/closed_form.hpp"
#include "support/methods_under_test.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

// --- tunnelling

constexpr int kShots = 20000;

/// A ball of radius R/2 shot at another with a random offset, from a random phase of the steps.
/// R = 1, v = 1.
TestScene shot(bool planar, double step, RandomNumbers& random) {
  double y = random.uniform(-1, 1);
  double z = planar ? 0 : random.uniform(-1, 1);
  while (y * y + z * z >= 1) {
    y = random.uniform(-1, 1);
    z = planar ? 0 : random.uniform(-1, 1);
  }
  TestScene scene;
  if (planar) scene.surroundings = planarSpace();
  const double x = -1.5 - random.uniform(0, step);
  scene.balls = {{Vector3(x, y, z), Vector3(1, 0, 0), 0.5, 1},
                 {Vector3::Zero(), Vector3::Zero(), 0.5, 1}};
  return scene;
}

struct Misses {
  double unresolved = 0;  ///< share of shots that changed nothing
  double unseen = 0;      ///< share that never were in overlap at the end of a step
};

Misses missesOfDiscrete(bool planar, double step) {
  RandomNumbers random(planar ? 1 : 2);
  int unresolved = 0;
  int unseen = 0;
  for (int i = 0; i < kShots; ++i) {
    Trial run("discrete", shot(planar, step, random), stepsOf(step));
    bool seen = false;
    for (int k = 1; k * step < 3.5; ++k) {
      run.advanceTo(k * step);
      seen = seen || (run.position(1) - run.position(0)).norm() < 1;
    }
    if (!run.collisions().empty()) continue;
    ++unresolved;
    if (!seen) ++unseen;
  }
  return {double(unresolved) / kShots, double(unseen) / kShots};
}

double threeSigma(double share) { return 3 * std::sqrt(share * (1 - share) / kShots); }

// A shot is inside for a chord c. None of the steps falls on it with probability 1 - c/L where
// c < L = v dt; averaged over the offsets that is L^2/12 in space, L^2/24 in the plane (to L^4).
// Only the first half of the chord approaches: with c/2 for c, L^2/3 and L^2/6.
TEST(Tunnelling, DiscreteMissesWhatTheFormulaSays) {
  const double step = 0.4;  // the plane's next order is 0.15 L^2, 2 % of the share
  const double square = step * step;
  const Misses space = missesOfDiscrete(false, step);
  EXPECT_NEAR(space.unseen, square / 12, threeSigma(square / 12));
  EXPECT_NEAR(space.unresolved, square / 3, threeSigma(square / 3));
  const Misses plane = missesOfDiscrete(true, step);
  EXPECT_NEAR(plane.unseen, square / 24, threeSigma(square / 24));
  EXPECT_NEAR(plane.unresolved, square / 6, threeSigma(square / 6));
}

TEST(Tunnelling, ExactMethodsMissNothing) {
  for (const std::string& name : exactMethods()) {
    RandomNumbers random(3);
    for (int i = 0; i < kShots / 10; ++i) {
      Trial run(name, shot(i % 2 == 0, 0.3, random));
      run.advanceTo(4);
      ASSERT_EQ(run.collisions().size(), 1u) << name << " " << i;
    }
  }
}

TEST(Tunnelling, DiscreteWarnsBeforeItMatters) {
  TestScene scene;
  scene.balls = {{Vector3::Zero(), Vector3(1, 0, 0), 0.5, 1}};
  Trial fine("discrete", scene, stepsOf(0.249));
  fine.advanceTo(10);
  EXPECT_EQ(fine.method().warning(), "");
  Trial coarse("discrete", scene, stepsOf(0.251));
  coarse.advanceTo(10);
  EXPECT_NE(coarse.method().warning().find("time_step"), std::string::npos);
}

// --- time lost at impacts, and overlap

TEST(Limits, DiscreteKeepsTheSpeedOfAFastBallButNotItsPlace) {  // 100 radii a step
  TestScene scene;
  scene.surroundings.box = {Vector3::Zero(), Vector3::Constant(3)};
  scene.balls = {{Vector3(1, 1.5, 1.5), Vector3(10, 0, 0), 0.1, 1}};
  Trial run("discrete", scene, stepsOf(1));
  run.advanceTo(100.5);
  EXPECT_EQ(std::abs(run.velocity(0).x()), 10);
  const FoldedLine truth(0.1L, 2.9L, 1, 10);
  EXPECT_GT(std::abs(run.position(0).x() - double(truth.positionAt(100.5L))), 1);
}

TEST(Limits, OverlapsOfDiscreteAreAStepDeep) {
  SceneKind kind;
  kind.count = 60;
  for (const double dt : {1e-3, 1e-4}) {
    const TestScene scene = randomScene(kind, 3);
    Trial run("discrete", scene, stepsOf(dt));
    run.advanceTo(3);
    double fastest = 0;  // m/s, an average speed shared out among 60 reaches thrice it
    for (const Vector3& v : run.states().velocities) fastest = std::max(fastest, v.norm());
    const double overlap = run.method().statistics().deepest_overlap;
    EXPECT_GT(overlap, 0.5 * fastest * dt);
    EXPECT_LT(overlap, 3 * fastest * dt);  // two such balls head-on, and one push more
  }
}

TEST(Limits, AHitDeepInsideGainsNothing) {  // a velocity bias would part them faster
  std::vector<std::string> names = exactMethods();
  names.push_back("discrete");
  for (const std::string& name : names) {
    TestScene scene;
    scene.balls = {{Vector3(-0.2, 0, 0), Vector3(1, 0, 0), 0.5, 1},
                   {Vector3(0.2, 0, 0), Vector3(-1, 0, 0), 0.5, 1}};
    Trial run(name, scene, stepsOf(0.01));
    run.advanceTo(2);
    EXPECT_EQ(run.velocity(0), Vector3(-1, 0, 0));
    EXPECT_EQ(run.velocity(1), Vector3(1, 0, 0));
  }
}

// After one step their centres are the same, and there is no line of centres to part along.
TEST(Limits, CoincidentCentresAfterAStepStayFinite) {
  for (const char* name : {"discrete", "soft_sphere"}) {
    TestScene scene;
    scene.balls = {{Vector3(-1, 0, 0), Vector3(1, 0, 0), 0.5, 1},
                   {Vector3(1, 0, 0), Vector3(-1, 0, 0), 0.5, 1}};
    Trial run(name, scene, stepsOf(1));
    run.advanceTo(1);
    ASSERT_EQ(run.position(0), run.position(1)) << name;
    run.advanceTo(100);
    EXPECT_TRUE(run.position(0).allFinite() && run.position(1).allFinite()) << name;
    EXPECT_EQ(Vector3(run.velocity(0) + run.velocity(1)), Vector3(0, 0, 0)) << name;
    EXPECT_LE(double(kineticEnergyOf(scene, run.states())), 1 + 1e-15) << name;
  }
}

// Spheres in a close-packed lattice with gaps of a share of their diameter meet as often as the
// gaps are small: an event-driven method's simulated time an event goes to nothing with them.
TEST(Limits, NearClosePackingTheEventsOfASecondHaveNoBound) {
  constexpr int kCells = 3;  // along an edge, of four balls each
  constexpr std::uint64_t kEvents = 40000;
  for (const std::string& name : fastMethods()) {
    std::vector<double> reached;  // s, over the gap
    for (const double gap : {1e-3, 1e-6}) {
      RandomNumbers random(4);
      TestScene scene;
      const double cell = std::sqrt(2) * (1 + gap);  // m, of balls with a diameter of 1 m
      scene.surroundings.periodic = true;
      scene.surroundings.box = {Vector3::Zero(), Vector3::Constant(kCells * cell)};
      for (int i = 0; i < kCells * kCells * kCells; ++i) {
        const Vector3 corner(i % kCells, i / kCells % kCells, i / (kCells * kCells));
        for (const Vector3& place :
             {Vector3(0, 0, 0), Vector3(0, 0.5, 0.5), Vector3(0.5, 0, 0.5), Vector3(0.5, 0.5, 0)}) {
          scene.balls.push_back({cell * (corner + place), random.gaussianVector(1), 0.5, 1});
        }
      }
      Trial run(name, scene);
      run.log().capacity = 0;
      ASSERT_FALSE(run.method().advanceTo(Time::fromSeconds(1000), kEvents)) << name;
      reached.push_back(run.method().now().seconds() / gap);
      EXPECT_GT(run.method().statistics().ball_collisions, kEvents / 4) << name;
      EXPECT_LT(run.method().statistics().deepest_overlap, 1e-10) << name;
      EXPECT_NEAR(double(kineticEnergyOf(scene, run.states()) /
                         kineticEnergyOf(scene, Trial(name, scene).states())),
                  1, 1e-12);
    }
    // In proportion, but for what events are spent on besides impacts.
    EXPECT_GT(reached[0], 0) << name;
    EXPECT_NEAR(reached[1] / reached[0], 1, 0.5) << name;
  }
}

// --- bounces without end

TEST(Limits, DiscreteComesToRestInAboutTheTimeOfTheFormula) {
  constexpr double kStep = 1e-3;
  for (const double e : {0.5, 0.9}) {
    const BouncingBall truth(5, 10, static_cast<LongDouble>(e));
    TestScene scene{floorUnderGravity(10, e), {{Vector3(0, 0, 5.5), Vector3::Zero(), 0.5, 1}}};
    Trial run("discrete", scene, stepsOf(kStep));
    run.advanceTo(30);
    ASSERT_FALSE(run.collisions().empty());
    const double bounces = double(run.collisions().size());
    // Seen late, each also loses a little: at e = 0.9 four bounces fewer of 59.
    const double formula = std::log(10 / (20 * kStep)) / std::log(1 / e);
    EXPECT_NEAR(bounces, formula, 1 + 0.08 * formula) << e;
    // Each is seen up to a step late, and takes as long to get back at e of the speed; the last,
    // slower than 2 g dt, would have lasted 4 dt/(1 - e).
    const double late = bounces * kStep * (1 + 1 / e) + 4 * kStep / (1 - e);
    EXPECT_NEAR(run.collisions().back().time.seconds(), double(truth.restTime()), late) << e;
    EXPECT_NEAR(run.position(0).z(), 0.5, 5e-4);  // what overlap resting contacts are left
    EXPECT_LT(run.velocity(0).norm(), 1e-12);
  }
}

TEST(Limits, SoftSphereComesToRestInAboutTheTimeOfTheFormula) {
  constexpr double kStep = 2e-5;
  constexpr double kContactTime = 50 * kStep;
  const double e = 0.5;
  const BouncingBall truth(5, 10, static_cast<LongDouble>(e));
  TestScene scene{floorUnderGravity(10, e), {{Vector3(0, 0, 5.5), Vector3::Zero(), 0.5, 1}}};
  Trial run("soft_sphere", scene, stepsOf(kStep));
  run.advanceTo(4);
  // Bounces of about the contact time are none: below g t_c, after log(1000)/log 2 of them.
  const double bounces = double(run.collisions().size());
  EXPECT_NEAR(bounces, 10, 3);
  // A contact found up to a step late loses up to 2 b dt of its dashpot, b = ln 2/t_c; flight n, of
  // 2 e^n s, errs by n of these, in all by 8 b dt.
  const double error = 8 * std::log(2) / kContactTime * kStep + bounces * kContactTime;
  EXPECT_NEAR(run.collisions().back().time.seconds(), double(truth.restTime()), error);
  // It lies where the spring bears it: less than g (t_c/pi)^2 deep.
  EXPECT_NEAR(run.position(0).z(), 0.5, 10 * std::pow(kContactTime / 3.14, 2));
  EXPECT_LT(run.velocity(0).norm(), 1e-9);
}

// Three balls on a line: exact ones meet without end below e = 7 - 4 sqrt(3) = 0.0718.
TEST(Limits, StepsEndAnInelasticCollapse) {
  for (const char* name : {"discrete", "soft_sphere"}) {
    for (const double e : {0.05, 0.1}) {
      TestScene scene;
      scene.surroundings.restitution = e;
      scene.balls = {{Vector3(-1.6, 0, 0), Vector3(1, 0, 0), 0.5, 1},
                     {Vector3::Zero(), Vector3::Zero(), 0.5, 1},
                     {Vector3(1.6, 0, 0), Vector3(-1, 0, 0), 0.5, 1}};
      Trial run(name, scene, stepsOf(1e-3));
      run.advanceTo(5, 15003);  // 5000 steps of three balls
      EXPECT_NEAR(double(momentumOf(scene, run.states()).x()), 0, 1e-14);
      // At once both springs push the middle ball, and more of the energy stays than in pairs.
      EXPECT_LT(double(kineticEnergyOf(scene, run.states())), 0.1) << name << e;
      EXPECT_LT(run.position(0).x(), run.position(1).x());
      EXPECT_LT(run.position(1).x(), run.position(2).x());
    }
  }
}

// --- ratios, and places far away

TEST(Limits, AnyMassRatioIsRight) {
  for (const char* name : {"discrete", "soft_sphere"}) {
    for (const double ratio : {10.0, 1e12, 1e50}) {
      TestScene scene;
      scene.balls = {{Vector3(-3, 0, 0), Vector3(1, 0, 0), 0.5, ratio},
                     {Vector3::Zero(), Vector3::Zero(), 0.5, 1}};
      Trial run(name, scene, stepsOf(1e-4));
      run.advanceTo(4);
      ASSERT_EQ(run.collisions().size(), 1u) << name;
      // The spring errs by 2e-5 of the energy at 50 steps a contact.
      const double error = std::string(name) == "discrete" ? 1e-15 : 2e-5;
      EXPECT_NEAR(run.velocity(1).x(), 2 * ratio / (ratio + 1), 2 * error) << name << ratio;
      EXPECT_NEAR(run.velocity(0).x(), (ratio - 1) / (ratio + 1), error) << name << ratio;
    }
  }
}

/// Number of impacts of Galperin's billiard, as the method counts them.
std::uint64_t digitsOfPi(const std::string& method, int k, double time_step) {
  TestScene scene;
  scene.surroundings.box.min.x() = 0;
  scene.balls = {{Vector3(2, 0, 0), Vector3::Zero(), 0.5, 1},
                 {Vector3(4, 0, 0), Vector3(-1, 0, 0), 0.5, std::pow(100, k)}};
  Trial run(method, scene, stepsOf(time_step));
  run.advanceTo(20);
  const Statistics counted = run.method().statistics();
  return counted.ball_collisions + counted.wall_collisions;
}

// At the turn the light ball is as fast as 10^k m/s. While that is no more than a sum of radii, 1
// m, in a step, nothing is lost; at three times that the ball is in the wall and in the other at
// once, and out behind them.
TEST(Limits, DiscreteCountsPiOnlyWhileNothingOutrunsAStep) {
  EXPECT_EQ(digitsOfPi("discrete", 2, 1e-2), 314u);
  EXPECT_NE(digitsOfPi("discrete", 2, 3e-2), 314u);
  EXPECT_EQ(digitsOfPi("discrete", 3, 1e-3), 3141u);
  EXPECT_NE(digitsOfPi("discrete", 3, 3e-3), 3141u);
}

TEST(Limits, PlacesFarAwayLoseOnlyTheirUlps) {
  SceneKind kind;
  kind.count = 20;
  const TestScene near = randomScene(kind, 9);
  kind.offset = 1e6;
  const TestScene far = randomScene(kind, 9);
  for (const char* name : {"discrete", "soft_sphere"}) {
    Trial here(name, near, stepsOf(1e-3));
    Trial there(name, far, stepsOf(1e-3));
    here.advanceTo(0.25);
    there.advanceTo(0.25);
    EXPECT_GT(here.collisions().size(), 3u);
    ASSERT_EQ(here.collisions().size(), there.collisions().size());
    for (BallId id = 0; id < 20; ++id) {
      const Vector3 shifted = there.position(id) - Vector3(1e6, 0, 0);
      // An ulp of 1e6 is 1e-10; each of 250 steps rounds by half of it, and impacts spread it.
      EXPECT_LT((shifted - here.position(id)).norm(), 1e-7) << name << id;
    }
  }
}

// Steps are counted from the first insertion, whatever the date.
TEST(Limits, LateStepsAreAsGoodAsEarlyOnes) {
  SceneKind kind;
  kind.count = 20;
  const TestScene scene = randomScene(kind, 9);
  for (const char* name : {"discrete", "soft_sphere"}) {
    Trial early(name, scene, stepsOf(1e-3));
    early.advanceTo(0.4997);  // between two steps
    EXPECT_GT(early.collisions().size(), 3u);
    Trial late(name, {scene.surroundings, {}}, stepsOf(1e-3));
    late.advanceTo(0x1p30);
    for (std::size_t i = 0; i < scene.balls.size(); ++i) {
      late.method().insert(static_cast<BallId>(i), scene.balls[i]);
    }
    ASSERT_TRUE(late.method().advanceTo(Time::fromSeconds(0x1p30) + 0.4997, 1000000));
    // Dates are kept as whole seconds and a rest, so not even the last bit has a reason to differ.
    for (BallId id = 0; id < 20; ++id) {
      EXPECT_EQ(late.position(id), early.position(id)) << name << id;
      EXPECT_EQ(late.velocity(id), early.velocity(id)) << name << id;
    }
  }
}

TEST(Limits, MethodsThatTakeImpactsOneByOneRefuseToTakeThemTogether) {
  MethodSettings together;
  together.simultaneous_impacts = SimultaneousImpacts::simultaneous;
  for (const char* name : {"continuous", "discrete", "soft_sphere"}) {
    try {
      makeMethod(name, Surroundings(), together);
      ADD_FAILURE() << name << " took it";
    } catch (const std::invalid_argument& error) {
      const std::string text = error.what();
      EXPECT_NE(text.find(name), std::string::npos) << text;
      EXPECT_NE(text.find("event_driven and brute_force can"), std::string::npos) << text;
    }
  }
  for (const std::string& name : jointMethods()) {
    EXPECT_NO_THROW(makeMethod(name, Surroundings(), together));
  }
}

// --- what the border keeps out, whatever the method

class Border : public testing::TestWithParam<std::string> {
 protected:
  static Scene scene() {
    Scene scene;
    scene.method = GetParam();
    scene.time_step = 0.01;
    scene.balls = {{Vector3::Zero(), Vector3(0.5, 0, 0), 0.5, 1},
                   {Vector3(3, 0, 0), Vector3(1, 0, 0), 0.5, 1}};
    return scene;
  }
};

TEST_P(Border, SpawningIntoABallIsRefusedAndChangesNothing) {
  World world(scene());
  world.advanceTo(Time::fromSeconds(0.995));  // between two steps: ball 1 is at 3.995
  const double energy = world.kineticEnergy();
  const SpawnResult result = world.spawn({{Vector3(4.5, 0, 0), Vector3::Zero(), 0.1, 1}});
  EXPECT_FALSE(result.accepted());
  EXPECT_EQ(result.refusals[0].code, RefusalCode::overlap);
  EXPECT_NE(result.refusals[0].reason.find("ball 1"), std::string::npos);
  EXPECT_EQ(world.kineticEnergy(), energy);
  world.advanceTo(Time::fromSeconds(2));
  EXPECT_EQ(world.kineticEnergy(), energy);
  EXPECT_EQ(world.statistics().ball_collisions, 0u);
}

TEST_P(Border, NumbersThatAreNoneAreRefusedByName) {
  World world(scene());
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  const auto refused = [&](const Ball& ball, const std::string& field) {
    const SpawnResult result = world.spawn(std::vector<Ball>{ball});
    EXPECT_FALSE(result.accepted()) << field;
    EXPECT_EQ(result.refusals[0].reason.find(field), 0u) << result.refusals[0].reason;
  };
  for (const double bad : {nan, infinity}) {
    refused({Vector3(0, bad, 9), Vector3::Zero(), 0.1, 1}, "position");
    refused({Vector3(0, 0, 9), Vector3(0, 0, bad), 0.1, 1}, "velocity");
    refused({Vector3(0, 0, 9), Vector3::Zero(), bad, 1}, "radius");
  }
  for (const double bad : {nan, 0.0, -1.0, 5e-324}) {
    refused({Vector3(0, 0, 9), Vector3::Zero(), 0.1, bad}, "mass");
  }
  for (const double bad : {0.0, -1.0, 5e-324}) {
    refused({Vector3(0, 0, 9), Vector3::Zero(), bad, 1}, "radius");
  }
  EXPECT_THROW(world.applyImpulse(0, {nan, 0, 0}), Refused);
  EXPECT_EQ(world.size(), 2u);
  world.advanceTo(Time::fromSeconds(1));
  EXPECT_EQ(world.ball(1).velocity, Vector3(1, 0, 0));
}

TEST_P(Border, APushWhileTheyPartIsAllThatHappens) {
  World world(scene());
  world.advanceTo(Time::fromSeconds(1.003));
  const auto change = world.applyImpulse(1, {0.25, 0, 0});
  EXPECT_NEAR((change.after - Vector3(1.25, 0, 0)).norm(), 0, 1e-15);
  world.advanceTo(Time::fromSeconds(2.003));
  EXPECT_EQ(world.statistics().ball_collisions, 0u);
  EXPECT_NEAR(world.ball(1).position.x(), 4.003 + 1.25, 1e-14);
  EXPECT_EQ(world.ball(0).velocity, Vector3(0.5, 0, 0));
}

std::vector<std::string> allMethods() {
  std::vector<std::string> names = methodNames();
  names.erase(std::remove(names.begin(), names.end(), "auto"), names.end());
  return names;
}

INSTANTIATE_TEST_SUITE_P(AllMethods, Border, testing::ValuesIn(allMethods()), methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
