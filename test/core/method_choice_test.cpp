// The numbers that `auto` chooses by, against theory, measurement and runs; and the choice itself.
#include "ball_sim/method_choice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/fill.hpp"
#include "support/fluid_theory.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// Balls of diameter 1 and mass 1 whose velocities have a mean square of 1 along each axis.
std::vector<Ball> unitFluid(std::size_t count, int dimension) {
  std::vector<Ball> balls;
  for (std::size_t i = 0; i < count; ++i) {
    const double v = (i % 2 == 0 ? 1 : -1) * std::sqrt(dimension);
    balls.push_back({Vector3::Zero(), Vector3(v, 0, 0), 0.5, 1});
  }
  return balls;
}

TEST(Enskog, isTheEquationOfStateOfSpheres) {
  for (const double rho : {0.01, 0.2, 0.5, 0.9}) {
    const double rate = enskogCollisionRate(unitFluid(100, 3), 100 / rho, false);
    // Carnahan, Starling; equal but for rounding.
    EXPECT_NEAR(compressibilityFromRate(rate, 1, 1, 3), compressibilityOfSpheres(rho * kPi / 6),
                1e-12);
  }
}

TEST(Enskog, isTheEquationOfStateOfDiscs) {
  for (const double eta : {0.01, 0.2, 0.5}) {
    const double rate = enskogCollisionRate(unitFluid(100, 2), 100 * kPi / 4 / eta, true);
    // Henderson; equal but for rounding.
    EXPECT_NEAR(compressibilityFromRate(rate, 1, 1, 2), compressibilityOfDiscs(eta), 1e-12);
  }
}

TEST(Enskog, agreesWithPublishedCounts) {
  // Collisions per ball and unit time, measured by others to three digits.
  EXPECT_NEAR(enskogCollisionRate(unitFluid(100, 3), 100 * kPi / 6 / 0.05, false), 0.770, 0.005);
  EXPECT_NEAR(enskogCollisionRate(unitFluid(100, 3), 100 * kPi / 6 / 0.2, false), 4.77, 0.05);
}

TEST(Enskog, seesNoCommonMotion) {
  std::vector<Ball> balls = unitFluid(10, 3);
  const double rate = enskogCollisionRate(balls, 100, false);
  for (Ball& ball : balls) ball.velocity += Vector3(1e3, -50, 7);
  EXPECT_NEAR(enskogCollisionRate(balls, 100, false) / rate, 1, 1e-9);
}

// A moving ball among many fixed ones: n pi R^2 times its mean speed, sqrt(8/pi) of Gaussians.
TEST(Enskog, countsFixedBallsAsTargets) {
  std::vector<Ball> balls(1000);
  for (Ball& ball : balls) ball = {Vector3::Zero(), Vector3::Zero(), 0.01, kFixed};
  balls[0] = {Vector3::Zero(), Vector3(std::sqrt(3.0), 0, 0), 0.01, 1};
  const double expected = 999 / 1e3 * kPi * 0.02 * 0.02 * std::sqrt(8 / kPi);
  // It takes itself for one more target, which moves: sqrt(2)/999.
  EXPECT_NEAR(enskogCollisionRate(balls, 1e3, false) / expected, 1, 2e-3);
}

Scene polydisperse(bool planar) {
  Scene scene;
  scene.surroundings.periodic = true;
  if (planar) scene.surroundings.box.min.z() = scene.surroundings.box.max.z() = 0;
  Fill fill;
  fill.count = 800;
  fill.radius = {0.05, 0.15};
  fill.density = 1000;
  fill.speed_sigma = 1;
  fill.seed = 5;
  fill.packing_fraction = planar ? 0.35 : 0.2;
  scene.fill = {fill};
  return scene;
}

TEST(Enskog, foreseesTheRateOfARunOfMixedSizes) {
  for (const bool planar : {false, true}) {
    Scene scene = polydisperse(planar);
    const std::vector<Ball> balls = populate(scene);
    Trial run("event_driven", {scene.surroundings, balls});
    // To equipartition: a heavy ball needs some tens of collisions. Then count, at the speeds then.
    const SceneNumbers start = sceneNumbers(scene.surroundings, balls);
    run.advanceTo(40 / start.collision_rate);
    std::vector<Ball> mixed;
    for (std::size_t i = 0; i < balls.size(); ++i) {
      mixed.push_back(run.method().ball(static_cast<BallId>(i)));
    }
    const double rate = sceneNumbers(scene.surroundings, mixed).collision_rate;
    const auto before = static_cast<double>(run.method().statistics().ball_collisions);
    run.advanceTo(run.method().now().seconds() + 50 / start.collision_rate);
    const auto count = static_cast<double>(run.method().statistics().ball_collisions) - before;
    const double counted = 2 * count / (800 * 50 / start.collision_rate);
    // The speeds of a dozen classes of 70 balls are a sample: 2 %; the theory is good to 1 %.
    EXPECT_NEAR(counted / rate, 1, 0.03) << (planar ? "discs" : "spheres");
    // Where all sizes have one speed, as the scene has them, it is another rate.
    EXPECT_GT(std::abs(start.collision_rate / rate - 1), 0.1);
  }
}

TEST(Chaos, growsAsMeasured) {
  // Bits per collision and ball, from the error of a return after time reversal.
  EXPECT_NEAR(chaosBits(0.1 * kPi / 6, false), 3.3, 1e-12);
  EXPECT_NEAR(chaosBits(0.5 * kPi / 6, false), 1.1, 1e-12);
  EXPECT_NEAR(chaosBits(0.9 * kPi / 6, false), 0.5, 1e-12);
  EXPECT_NEAR(chaosBits(0.2, true), 2.2, 1e-12);
  EXPECT_NEAR(chaosBits(0.55, true), 0.8, 1e-12);
  for (const bool planar : {false, true}) {
    for (double eta = 1e-4; eta < 0.6; eta *= 1.5) {
      EXPECT_GE(chaosBits(eta, planar), chaosBits(1.5 * eta, planar));
    }
  }
}

TEST(Chaos, horizonIsWhereRunsDiverge) {
  const double bits = chaosBits(0.5 * kPi / 6, false);
  // Measured: 4e-14 after 4 collisions a ball, 1e-7 after 22, 1e-2 after 37.
  EXPECT_NEAR(horizonInCollisions(bits, 4e-14), 4, 0.5);
  EXPECT_NEAR(horizonInCollisions(bits, 1e-7), 22, 2.2);
  EXPECT_NEAR(horizonInCollisions(bits, 1e-2), 37, 3.7);
  EXPECT_EQ(horizonInCollisions(bits, 1e-16), 0) << "finer than rounding: none";
}

// Two runs that differ by rounding part at the horizon.
TEST(Chaos, horizonHoldsForARun) {
  Scene scene = polydisperse(false);
  scene.fill[0].radius = {0.1, 0.1};
  const std::vector<Ball> balls = populate(scene);
  const SceneNumbers numbers = sceneNumbers(scene.surroundings, balls);
  const TestScene start = {scene.surroundings, balls};
  const auto difference = [&](double date) {
    Trial fine("event_driven", start, Precision::long_double);
    Trial coarse("event_driven", start, Precision::double_precision);
    fine.advanceTo(date);
    coarse.advanceTo(date);
    double worst = 0;
    for (BallId id = 0; id < balls.size(); ++id) {
      worst = std::max(worst, (fine.position(id) - coarse.position(id)).norm() / 0.1);
    }
    return worst;
  };
  const double horizon =
      horizonInCollisions(numbers.bits_per_collision, 1e-4) / numbers.collision_rate;
  // The estimate is of the typical ball, and this is the worst of 800: it parts a few collisions
  // earlier, some 30 % of the horizon.
  EXPECT_LT(difference(0.6 * horizon), 1e-4);
  EXPECT_GT(difference(1.2 * horizon), 1e-4);
}

TEST(SceneNumbers, describeTheScene) {
  Scene scene = polydisperse(false);
  const std::vector<Ball> balls = populate(scene);
  const SceneNumbers numbers = sceneNumbers(scene.surroundings, balls);
  EXPECT_EQ(numbers.balls, 800u);
  EXPECT_FALSE(numbers.planar);
  EXPECT_NEAR(numbers.packing_fraction, 0.2, 1e-9);
  EXPECT_NEAR(numbers.mean_radius, 0.1, 0.005);
  EXPECT_NEAR(numbers.mean_speed, std::sqrt(8 / kPi), 0.1);
  EXPECT_EQ(sceneNumbers(scene.surroundings, {}).balls, 0u);
  EXPECT_EQ(sceneNumbers(Surroundings(), unitFluid(40, 3)).collision_rate > 0, true);
}

const std::vector<std::string> kToday = {"auto", "event_driven", "brute_force"};

TEST(Choice, tellsItsNumbers) {
  SceneNumbers numbers;
  numbers.balls = 1000;
  numbers.collision_rate = 3.1;
  numbers.mean_radius = 0.1;
  numbers.mean_speed = 1;
  numbers.volume = 10;
  numbers.bits_per_collision = 1.1;
  // log2(1e-6 / 2e-15) / 1.1 / 3.1 = 8.5 s.
  const MethodChoice fine = chooseFor(numbers, 1e-6, kToday);
  EXPECT_EQ(fine.name, "event_driven");
  EXPECT_EQ(fine.reason, "3.1 collisions per ball and second, horizon 8.5 s at 1e-06");
  // log2(1e-2 / 2e-15) / 1.1 / 3.1 = 12.4 s.
  EXPECT_EQ(chooseFor(numbers, std::nullopt, kToday).reason,
            "3.1 collisions per ball and second, horizon 12 s at 0.01");
}

TEST(Chaos, ofEqualBallsIsThatOfTheirDensity) {
  Scene scene = polydisperse(false);
  scene.fill[0].radius = {0.1, 0.1};
  const std::vector<Ball> balls = populate(scene);
  const SceneNumbers numbers = sceneNumbers(scene.surroundings, balls);
  EXPECT_NEAR(numbers.bits_per_collision, chaosBits(0.2, false), 1e-9);
  EXPECT_NEAR(horizonInSeconds(numbers, 1e-6),
              horizonInCollisions(numbers.bits_per_collision, 1e-6) / numbers.collision_rate,
              1e-12);
  EXPECT_EQ(horizonInSeconds(SceneNumbers(), 1e-6), std::numeric_limits<double>::infinity());
}

// A few large and heavy balls fill the room, but do not make a thin gas of small ones less chaotic;
// nor do their own many collisions, which turn them little.
TEST(Chaos, ofAGasAmongLargeBallsIsThatOfTheGas) {
  std::vector<Ball> balls = unitFluid(3000, 3);
  for (std::size_t i = 0; i < 4; ++i) {
    balls[i].radius = 10;
    balls[i].mass = 8000;
    balls[i].velocity /= 90;
  }
  Surroundings around;
  around.periodic = true;
  around.box.min = Vector3::Zero();
  around.box.max = Vector3::Constant(50);
  const SceneNumbers mixed = sceneNumbers(around, balls);
  EXPECT_GT(mixed.packing_fraction, 0.13);
  const double alone = chaosBits(2996 * kPi / 6 / (50 * 50 * 50 * 0.87), false);
  EXPECT_NEAR(mixed.bits_per_collision / alone, 1, 0.25);
}

TEST(SceneNumbers, countWhatFallingGives) {
  Surroundings around = floorUnderGravity(10, 1);
  std::vector<Ball> balls;
  for (int i = 0; i < 64; ++i) {
    const Vector3 place(i % 4, i / 4 % 4, 1.1 + i / 16);
    balls.push_back({place, Vector3(i % 2 == 0 ? 3 : -3, 0, 0), 0.1, 1});
  }
  // Falls of 1, 2, 3 and 4 m: g h on average, 25 m^2/s^2, beside 9.
  const SceneNumbers falling = sceneNumbers(around, balls);
  EXPECT_FALSE(falling.settles);
  EXPECT_NEAR(falling.mean_speed, std::sqrt(9 + 25), 1e-12);
  around.gravity = Vector3::Zero();
  const SceneNumbers flying = sceneNumbers(around, balls);
  EXPECT_NEAR(flying.mean_speed, 3, 1e-12);
  EXPECT_NEAR(falling.collision_rate / flying.collision_rate, std::sqrt(34.0 / 9), 1e-12);
  around.gravity = Vector3(0, 0, 10);  // away from the floor, for ever
  EXPECT_NEAR(sceneNumbers(around, balls).mean_speed, 3, 1e-12);
  around = floorUnderGravity(10, 0.5);
  EXPECT_TRUE(sceneNumbers(around, balls).settles);
  EXPECT_NE(chooseFor(sceneNumbers(around, balls), 1e-6, kToday).reason.find("come to rest"),
            std::string::npos);
}

// Measured by bench/auto_benchmark: of balls of one size continuous is the cheaper where they are
// many in a thin gas, and nowhere else.
TEST(Choice, takesTheCheaperExactMethod) {
  const std::vector<std::string> both = {"auto", "event_driven", "continuous", "discrete"};
  const auto choiceFor = [&](double count, double packing_fraction) {
    SceneNumbers numbers;
    numbers.balls = static_cast<std::size_t>(count);
    numbers.mean_radius = 0.05;
    numbers.packing_fraction = packing_fraction;
    numbers.volume = count * 4 * kPi / 3 * std::pow(0.05, 3) / packing_fraction;
    numbers.mean_speed = std::sqrt(8 / kPi);
    const double chi = (1 - packing_fraction / 2) / std::pow(1 - packing_fraction, 3);
    numbers.collision_rate = 4 * 0.01 * count / numbers.volume * chi * std::sqrt(kPi);
    numbers.bits_per_collision = 1;
    return chooseFor(numbers, 1e-6, both);
  };
  EXPECT_EQ(choiceFor(1e3, 0.05).name, "event_driven");
  EXPECT_EQ(choiceFor(1e5, 0.45).name, "event_driven");
  EXPECT_EQ(choiceFor(1e4, 0.001).name, "continuous");
  EXPECT_EQ(choiceFor(1e4, 0.05).name, "event_driven");
  EXPECT_EQ(choiceFor(1e5, 0.2).name, "event_driven");
  EXPECT_EQ(choiceFor(1e5, 0.05).name, "continuous");
  EXPECT_EQ(choiceFor(1e5, 0.001).name, "continuous");
  EXPECT_NE(choiceFor(1e5, 0.001).reason.find("of the cost of event_driven"), std::string::npos);
}

// For their few impacts with all that is around them event_driven searches a large part of the
// balls: measured, 1.1 times the cost of continuous for mixed_sizes.yaml.
TEST(Choice, countsTheCrowdAroundLargeBalls) {
  std::vector<Ball> balls = unitFluid(3004, 3);
  for (Ball& ball : balls) ball.radius = 0.03;
  Surroundings around;
  around.periodic = true;
  around.box.min = Vector3::Zero();
  around.box.max = Vector3::Constant(2);
  const SceneNumbers dust = sceneNumbers(around, balls);
  EXPECT_NEAR(dust.crowd, 3004 / 8.0 * std::pow(0.06, 3), 1e-9);
  EXPECT_EQ(chooseFor(dust, 1e-6, methodNames()).name, "event_driven");
  for (std::size_t i = 0; i < 4; ++i) balls[i] = {Vector3::Zero(), Vector3::Zero(), 0.3, 27000};
  const SceneNumbers mixed = sceneNumbers(around, balls);
  EXPECT_GT(mixed.crowd, 1);
  EXPECT_EQ(chooseFor(mixed, 1e-6, methodNames()).name, "continuous");
}

TEST(Choice, keepsToWhatTakesImpactsTogether) {
  Scene scene;
  scene.surroundings.periodic = true;
  scene.surroundings.box.min = Vector3::Zero();
  scene.surroundings.box.max = Vector3::Constant(400);  // a packing fraction of 0.0008
  const std::vector<Ball> balls = unitFluid(100000, 3);
  EXPECT_EQ(chooseMethod("auto", scene, balls).name, "continuous");
  scene.simultaneous_impacts = SimultaneousImpacts::simultaneous;
  EXPECT_EQ(chooseMethod("auto", scene, balls).name, "event_driven");
}

TEST(Choice, takesWhatIsThereAndExact) {
  SceneNumbers numbers;
  EXPECT_EQ(chooseFor(numbers, 0.5, kToday).name, "event_driven");
  numbers.balls = 2;
  EXPECT_NE(chooseFor(numbers, 0.5, kToday).reason.find("few"), std::string::npos);
  numbers.balls = 1000;
  EXPECT_NE(chooseFor(numbers, 0.5, kToday).reason.find("nothing moves"), std::string::npos);
  EXPECT_FALSE(estimatedCost("brute_force", numbers).has_value());
  EXPECT_FALSE(estimatedCost("discrete", numbers).has_value()) << "it keeps no tolerance";
}

TEST(Choice, leavesOtherNamesAlone) {
  const MethodChoice choice = chooseMethod("brute_force", Scene(), {});
  EXPECT_EQ(choice.name, "brute_force");
  EXPECT_EQ(choice.reason, "asked for");
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
