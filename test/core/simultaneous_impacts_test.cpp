// Impacts at one instant that share balls, under both policies.
#include "ball_sim/simultaneous_impacts.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "support/methods_under_test.hpp"
#include "support/random_numbers.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr auto kSequential = SimultaneousImpacts::sequential;
constexpr auto kSimultaneous = SimultaneousImpacts::simultaneous;

MethodSettings settingsOf(SimultaneousImpacts policy) {
  MethodSettings settings;
  settings.simultaneous_impacts = policy;
  return settings;
}

/// Balls of radius 0.5 that touch in a row along x.
TestScene row(const std::vector<double>& masses, const std::vector<double>& speeds) {
  TestScene scene;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    scene.balls.push_back({Vector3(double(i), 0, 0), Vector3(speeds[i], 0, 0), 0.5, masses[i]});
  }
  return scene;
}

/// A cue ball of speed 1 that touches two balls at +-30 degrees.
TestScene cueIntoTwo() {
  TestScene scene = row({1}, {1});
  const double x = std::sqrt(0.75);
  scene.balls.push_back({Vector3(x, 0.5, 0), Vector3::Zero(), 0.5, 1});
  scene.balls.push_back({Vector3(x, -0.5, 0), Vector3::Zero(), 0.5, 1});
  return scene;
}

/// Fifteen balls that touch, in a triangle whose axis is x, and a cue ball that comes along it.
/// Balls of mirrored y stand next to each other; so do their ids.
TestScene rack(double cue_speed) {
  TestScene scene;
  scene.surroundings = planarSpace();
  scene.balls.push_back({Vector3(-1.25, 0, 0), Vector3(cue_speed, 0, 0), 0.5, 1});
  for (int line = 0; line < 5; ++line) {
    const double x = line * std::sqrt(0.75);
    for (int k = line; k >= 0; k -= 2) {
      const double y = k * 0.5;
      scene.balls.push_back({Vector3(x, y, 0), Vector3::Zero(), 0.5, 1});
      if (k > 0) scene.balls.push_back({Vector3(x, -y, 0), Vector3::Zero(), 0.5, 1});
    }
  }
  return scene;
}

/// How far a state is from its own mirror image in y = 0: of places m, or of velocities m/s.
double asymmetry(const BallStates& states) {
  double worst = 0;
  const Vector3 mirror(1, -1, 1);
  for (const Vector3& x : states.positions) {
    double nearest_place = 1e300;
    double its_speed = 0;
    for (std::size_t j = 0; j < states.positions.size(); ++j) {
      const double distance = (x.cwiseProduct(mirror) - states.positions[j]).norm();
      if (distance >= nearest_place) continue;
      nearest_place = distance;
      const auto i = static_cast<std::size_t>(&x - states.positions.data());
      its_speed = (states.velocities[i].cwiseProduct(mirror) - states.velocities[j]).norm();
    }
    worst = std::max({worst, nearest_place, its_speed});
  }
  return worst;
}

class Policies : public testing::TestWithParam<std::string> {
 protected:
  Trial after(const TestScene& scene, SimultaneousImpacts policy, double seconds = 1e-6) {
    Trial run(GetParam(), scene, settingsOf(policy));
    run.advanceTo(seconds, 10000);
    return run;
  }
};

// Values of the literature: Smith et al. (2012), and rational arithmetic.
TEST_P(Policies, cueBallIntoTwoPushesBothAlike) {
  const Trial run = after(cueIntoTwo(), kSimultaneous);
  const double speed = 2 * std::sqrt(3.0) / 5;
  // The balls of the scene touch to the rounding of sqrt(0.75): an ulp.
  EXPECT_NEAR((run.velocity(0) - Vector3(-0.2, 0, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR((run.velocity(1) - speed * Vector3(std::sqrt(0.75), 0.5, 0)).norm(), 0, 1e-15);
  EXPECT_EQ(run.velocity(2), Vector3(run.velocity(1).x(), -run.velocity(1).y(), 0));
  EXPECT_EQ(run.collisions().size(), 2u);
  EXPECT_EQ(run.method().statistics().ball_collisions, 2u);
  EXPECT_EQ(run.method().statistics().ambiguous_impacts, 1u);
}

TEST_P(Policies, cueBallIntoTwoInTurn) {
  const Trial run = after(cueIntoTwo(), kSequential);
  const double h = std::sqrt(3.0) / 2;
  EXPECT_NEAR(run.velocity(1).norm(), h, 1e-15);
  EXPECT_NEAR(run.velocity(2).norm(), h / 2, 1e-15);
  EXPECT_NEAR((run.velocity(0) - Vector3(-1.0 / 8, -h / 4, 0)).norm(), 0, 1e-15);
  EXPECT_EQ(run.method().statistics().ambiguous_impacts, 1u);
}

TEST_P(Policies, lightHeavyLight) {
  const TestScene scene = row({1, 2, 1}, {1, 0, -1});
  const Trial together = after(scene, kSimultaneous);
  EXPECT_NEAR(together.velocity(0).x(), -1, 1e-15);
  EXPECT_NEAR(together.velocity(1).x(), 0, 1e-15);
  EXPECT_NEAR(together.velocity(2).x(), 1, 1e-15);
  EXPECT_EQ(together.method().statistics().ambiguous_impacts, 1u);
  const Trial in_turn = after(scene, kSequential);
  EXPECT_NEAR(in_turn.velocity(0).x(), -13.0 / 27, 1e-15);
  EXPECT_NEAR(in_turn.velocity(1).x(), -10.0 / 27, 1e-15);
  EXPECT_NEAR(in_turn.velocity(2).x(), 33.0 / 27, 1e-15);
  EXPECT_GT(in_turn.method().statistics().ambiguous_impacts, 0u);
}

TEST_P(Policies, cradleLetsOutAsManyBallsAsCameIn) {
  for (const auto policy : {kSequential, kSimultaneous}) {
    for (std::size_t in = 1; in <= 4; ++in) {
      std::vector<double> speeds(5, 0.0);
      std::fill(speeds.begin(), speeds.begin() + static_cast<std::ptrdiff_t>(in), 1.0);
      const Trial run = after(row({1, 1, 1, 1, 1}, speeds), policy);
      for (std::size_t i = 0; i < 5; ++i) {
        EXPECT_EQ(run.velocity(static_cast<BallId>(i)).x(), i >= 5 - in ? 1.0 : 0.0)
            << "ball " << i << ", " << in << " in";
      }
      EXPECT_EQ(run.method().statistics().ambiguous_impacts, 0u);
    }
  }
}

// All five towards the middle: impacts at once, but at pi/3, so that no policy is needed.
TEST_P(Policies, equalBallsInARowNeedNoPolicy) {
  const TestScene scene = row({1, 1, 1, 1, 1}, {2, 1, 0, -1, -2});
  for (const auto policy : {kSequential, kSimultaneous}) {
    const Trial run = after(scene, policy);
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_NEAR(run.velocity(static_cast<BallId>(i)).x(), double(i) - 2, 1e-15);
    }
    EXPECT_EQ(run.method().statistics().ambiguous_impacts, 0u);
  }
}

TEST_P(Policies, ballBetweenWallAndBall) {
  // Wall at x = -0.5; masses 1 and 3, both moving to the wall at speed 1. The wedge in
  // mass-weighted coordinates is atan(sqrt(1/3)) = pi/6: no policy matters, and all speed is
  // turned.
  TestScene scene = row({1, 3}, {-1, -1});
  scene.surroundings.box.min.x() = -0.5;
  for (const auto policy : {kSequential, kSimultaneous}) {
    const Trial run = after(scene, policy);
    EXPECT_NEAR(run.velocity(0).x(), 1, 1e-15);
    EXPECT_NEAR(run.velocity(1).x(), 1, 1e-15);
    EXPECT_EQ(run.method().statistics().ambiguous_impacts, 0u);
  }
  // Ball 0 between the wall and a ball that hits it while it hits the wall. Together: the least
  // push into the plastic solution v = 0 is reflected, so each speed is turned.
  TestScene pressed = row({1, 2}, {-1, -2});
  pressed.surroundings.box.min.x() = -0.5;
  const Trial together = after(pressed, kSimultaneous);
  EXPECT_NEAR(together.velocity(0).x(), 1, 1e-15);
  EXPECT_NEAR(together.velocity(1).x(), 2, 1e-15);
  EXPECT_EQ(together.method().statistics().wall_collisions, 1u);
  EXPECT_EQ(together.method().statistics().ball_collisions, 1u);
  EXPECT_EQ(together.method().statistics().ambiguous_impacts, 1u);
  EXPECT_GT(after(pressed, kSequential).method().statistics().ambiguous_impacts, 0u);
}

TEST_P(Policies, restitutionHoldsAtEveryContact) {
  TestScene scene = cueIntoTwo();
  scene.surroundings.restitution = 0.5;
  const Trial run = after(scene, kSimultaneous);
  const double speed = 1.5 * std::sqrt(3.0) / 5;  // (1 + e) in place of 2
  EXPECT_NEAR((run.velocity(0) - Vector3(1 - 0.9, 0, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR(run.velocity(1).norm(), speed, 1e-15);
}

// Radii 0.5 m and gravity 10 m/s^2: a thousandth of the reach is a rise at 0.14 m/s.
TEST_P(Policies, contactsThatComeToRestAreNotCounted) {
  const auto ambiguous = [&](double speed, const Vector3& gravity, double restitution,
                             SimultaneousImpacts policy) {
    TestScene scene = row({1, 2, 1}, {speed, 0, -speed});
    scene.surroundings.gravity = gravity;
    scene.surroundings.restitution = restitution;
    return after(scene, policy).method().statistics().ambiguous_impacts;
  };
  const Vector3 along(-10, 0, 0);
  const Vector3 across(0, 0, -10);
  for (const auto policy : {kSequential, kSimultaneous}) {
    EXPECT_GT(ambiguous(0.2, along, 0.5, policy), 0u);
    EXPECT_EQ(ambiguous(0.1, along, 0.5, policy), 0u);
    EXPECT_EQ(ambiguous(0.1, Vector3(-1e-3, 0, -10), 0.5, policy), 0u) << "pressed by others";
    EXPECT_GT(ambiguous(0.1, along, 1, policy), 0u) << "elastic balls never rest";
    EXPECT_GT(ambiguous(0.001, across, 0.5, policy), 0u) << "they roll towards each other";
    EXPECT_GT(ambiguous(0.001, Vector3::Zero(), 0.5, policy), 0u);
  }
}

// What is left of a bounce is not enough to count, however hard the other impact is.
TEST_P(Policies, aHardImpactBesideOneThatComesToRestIsNotCounted) {
  for (const double slow : {0.1, 0.2}) {
    TestScene scene = row({1, 2, 1}, {3, 0, -slow});
    scene.surroundings.gravity = Vector3(-10, 0, 0);
    scene.surroundings.restitution = 0.5;
    const std::uint64_t count = after(scene, kSequential).method().statistics().ambiguous_impacts;
    EXPECT_EQ(count > 0, slow > 0.15) << slow;
    std::swap(scene.balls[0].velocity, scene.balls[2].velocity);
    scene.balls[0].velocity *= -1;
    scene.balls[2].velocity *= -1;
    const std::uint64_t other = after(scene, kSequential).method().statistics().ambiguous_impacts;
    EXPECT_EQ(other > 0, slow > 0.15) << slow;
  }
}

TEST_P(Policies, impactsAnUlpApartAreOneInstant) {
  // The cue ball flies a way that rounds: without a tolerance one side would be hit first.
  for (const double angle : {0.0, 0.3, 1.1, 2.5}) {
    TestScene scene = cueIntoTwo();
    scene.balls[0].position.x() -= 0.7;
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    for (Ball& ball : scene.balls) {
      const auto turned = [&](const Vector3& v) {
        return Vector3(c * v.x() - s * v.y(), s * v.x() + c * v.y(), v.z());
      };
      ball.position = turned(ball.position);
      ball.velocity = turned(ball.velocity);
    }
    const Trial run = after(scene, kSimultaneous, 1);
    ASSERT_EQ(run.collisions().size(), 2u) << "angle " << angle;
    EXPECT_NEAR(run.velocity(1).norm(), 2 * std::sqrt(3.0) / 5, 1e-14);
    EXPECT_NEAR(run.velocity(2).norm(), 2 * std::sqrt(3.0) / 5, 1e-14);
    EXPECT_GT(after(scene, kSequential, 1).method().statistics().ambiguous_impacts, 0u);
  }
}

TEST_P(Policies, aSymmetricBreakStaysSymmetric) {
  for (const double e : {1.0, 0.9}) {
    TestScene scene = rack(4);
    scene.surroundings.restitution = e;
    Trial run(GetParam(), scene, settingsOf(kSimultaneous));
    for (const double date : {0.08, 0.1, 0.5, 1.0, 4.0}) {  // the cue ball arrives at 0.0625
      run.advanceTo(date, 100000);
      // 1e-14 is what is asked for; sums in a wider type leave less than an ulp of the speeds.
      EXPECT_LT(asymmetry(run.states()), 1e-16) << "t = " << date;
    }
    EXPECT_GT(run.collisions().size(), 15u);
    EXPECT_GT(run.method().statistics().ambiguous_impacts, 0u);
    if (e == 1) {
      EXPECT_NEAR(double(kineticEnergyOf(scene, run.states())), 8, 8e-15);
    }
    EXPECT_NEAR(double(momentumOf(scene, run.states()).x()), 4, 1e-14);
    // The rack as the sequential policy leaves it is the counter-example.
    EXPECT_GT(asymmetry(after(scene, kSequential, 4).states()), 0.01);
  }
}

TEST_P(Policies, outcomeDoesNotDependOnIds) {
  const TestScene scene = rack(1);
  RandomNumbers random(11);
  const BallStates reference = after(scene, kSimultaneous, 0.3).states();
  for (int trial = 0; trial < 4; ++trial) {
    std::vector<std::size_t> order(scene.balls.size());
    std::iota(order.begin(), order.end(), 0u);
    for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.index(i)]);
    TestScene shuffled = scene;
    for (std::size_t i = 0; i < order.size(); ++i) shuffled.balls[i] = scene.balls[order[i]];
    const BallStates states = after(shuffled, kSimultaneous, 0.3).states();
    for (std::size_t i = 0; i < order.size(); ++i) {
      // Of a speed of 1, with roundings in another order.
      EXPECT_LT((states.velocities[i] - reference.velocities[order[i]]).norm(), 1e-15);
      EXPECT_LT((states.positions[i] - reference.positions[order[i]]).norm(), 4e-15);
    }
  }
}

// No tie and no touch: the policies are the same bits.
TEST_P(Policies, apartFromSharedInstantsThePoliciesAgree) {
  TestScene scene;
  scene.surroundings.box.min = Vector3::Constant(-1);
  scene.surroundings.box.max = Vector3::Constant(1);
  RandomNumbers random(3);
  for (int i = 0; i < 27; ++i) {
    const Vector3 cell(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    scene.balls.push_back({0.6 * cell, random.gaussianVector(1), random.uniform(0.1, 0.25), 1});
  }
  const Trial in_turn = after(scene, kSequential, 2);
  const Trial together = after(scene, kSimultaneous, 2);
  ASSERT_GT(in_turn.collisions().size(), 100u);
  for (BallId id = 0; id < 27; ++id) EXPECT_EQ(in_turn.position(id), together.position(id));
  EXPECT_EQ(in_turn.method().statistics().ambiguous_impacts, 0u);
  EXPECT_EQ(together.method().statistics().ambiguous_impacts, 0u);
}

/// A patch of a lattice whose balls touch, random velocities and masses, a fixed ball at times.
TestScene touchingLattice(RandomNumbers& random, bool periodic, bool walls, double restitution) {
  TestScene scene;
  const int n = 3;
  for (int i = 0; i < n * n * n; ++i) {
    const Vector3 place(i % n + 0.5, i / n % n + 0.5, i / n / n + 0.5);
    const double mass = std::pow(10, random.uniform(-1, 1));
    scene.balls.push_back({place, random.gaussianVector(1), 0.5, mass});
  }
  if (random.chance(0.5) && !walls) {  // between a fixed ball and a wall others would be jammed
    scene.balls[random.index(27)] = {scene.balls[13].position, Vector3::Zero(), 0.5, kFixed};
    scene.balls[13] = {Vector3(1.5, 1.5, 7), Vector3::Zero(), 0.5, 1};
  }
  if (periodic || walls) {
    scene.surroundings.box.min = Vector3::Zero();
    scene.surroundings.box.max = Vector3(n + 0.5, n + 0.5, 8);  // else they are jammed
  }
  scene.surroundings.periodic = periodic;
  scene.surroundings.restitution = restitution;
  return scene;
}

// The judge is the state after the instant: nothing that touches approaches, energy and momentum
// are kept; and the fast methods do as the slow twin.
TEST_P(Policies, randomTouchingClustersConserveAndPart) {
  RandomNumbers random(21);
  for (int trial = 0; trial < 24; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const double e = trial % 4 == 3 ? 0.8 : 1;
    const TestScene scene = touchingLattice(random, trial % 3 == 1, trial % 3 == 2, e);
    const Trial run = after(scene, kSimultaneous, 1e-9);
    const BallStates states = run.states();
    BallStates start = states;
    bool fixed = false;
    for (std::size_t i = 0; i < scene.balls.size(); ++i) {
      start.velocities[i] = scene.balls[i].velocity;
      fixed = fixed || scene.balls[i].mass == kFixed;
    }
    EXPECT_GT(run.collisions().size(), 20u);
    const double energy = double(kineticEnergyOf(scene, start));
    const double kept = double(kineticEnergyOf(scene, states)) / energy;
    if (e == 1) {
      EXPECT_NEAR(kept, 1, 1e-14);
    } else {
      EXPECT_LT(kept, 1);
    }
    if (!fixed && trial % 3 != 2) {
      const VectorOf<long double> change = momentumOf(scene, states) - momentumOf(scene, start);
      EXPECT_LT(double(change.norm()), 1e-13);
    }
    for (std::size_t i = 0; i < states.ids.size(); ++i) {
      for (std::size_t j = i + 1; j < states.ids.size(); ++j) {
        const Vector3 dx = states.positions[j] - states.positions[i];
        if (dx.norm() > 1 + 1e-7) continue;
        EXPECT_GT(dot(dx, Vector3(states.velocities[j] - states.velocities[i])), -1e-13);
      }
    }
    const BallStates twin = [&] {
      Trial slow(kSlowTwin, scene, settingsOf(kSimultaneous));
      slow.advanceTo(1e-9, 10000);
      return slow.states();
    }();
    for (std::size_t i = 0; i < states.ids.size(); ++i) {
      EXPECT_LT((twin.velocities[i] - states.velocities[i]).norm(), 1e-12) << "ball " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, Policies, testing::ValuesIn(jointMethods()), methodOf);

TEST(RefusedPolicies, methodsThatTakeNoImpactsTogetherNameThoseThatDo) {
  for (const char* name : {"continuous", "discrete", "soft_sphere"}) {
    try {
      makeMethod(name, {}, settingsOf(kSimultaneous));
      ADD_FAILURE() << name;
    } catch (const std::invalid_argument& refused) {
      EXPECT_EQ(std::string(refused.what()),
                "simultaneous_impacts: 'simultaneous': method " + std::string(name) +
                    " cannot take impacts together; event_driven and brute_force can");
    }
  }
}

// --- the pure functions

/// Whether it shows in which order the pairs of three balls in a row are taken, the ends, of mass
/// 1, coming in upon the middle.
bool orderShows(double mass_of_middle) {
  TestScene scene = row({1, mass_of_middle, 1}, {1, 0, -1});
  Trial left("brute_force", scene);
  left.advanceTo(1e-9, 10000);
  std::swap(scene.balls[0], scene.balls[2]);  // the smaller ids go first
  Trial right("brute_force", scene);
  right.advanceTo(1e-9, 10000);
  const double difference = (left.velocity(0) - right.velocity(2)).norm() +
                            (left.velocity(1) - right.velocity(1)).norm() +
                            (left.velocity(2) - right.velocity(0)).norm();
  return difference > 1e-9;  // rounding is 1e-15, and another order of the speeds' size
}

TEST(OrderMatters, exactlyWhereTheAngleIsNoWholePartOfPi) {
  const Vector3 left(-1, 0, 0);
  const Vector3 right(1, 0, 0);
  for (int k = 3; k <= 9; ++k) {
    // Equal ends of mass 1: cos(theta) = w / (w + 1), w of the ball in the middle.
    const double cosine = std::cos(3.14159265358979323846 / k);
    const double w = cosine / (1 - cosine);
    EXPECT_FALSE(orderMatters<double>(left, right, w, 1, 1, 1)) << "k = " << k;
    EXPECT_FALSE(orderShows(1 / w)) << "k = " << k;
    EXPECT_TRUE(orderMatters<double>(left, right, w, 1, 1, 0.5)) << "k = " << k;
    EXPECT_TRUE(orderMatters<double>(left, right, 1.01 * w, 1, 1, 1)) << "k = " << k;
    EXPECT_TRUE(orderShows(1 / (1.01 * w))) << "k = " << k;
  }
  const Vector3 up(0, 1, 0);
  EXPECT_FALSE(orderMatters<double>(left, up, 1, 2, 3, 0.5)) << "at right angles";
  EXPECT_FALSE(orderMatters<double>(left, right, 0, 1, 1, 1)) << "a fixed ball hands nothing on";
  EXPECT_FALSE(orderMatters<double>(left, up, 1, 0, 0, 0.5)) << "a corner of two walls";
  EXPECT_TRUE(orderMatters<double>(left, Vector3(0.8, 0.6, 0), 1, 0, 0, 1)) << "a skew corner";
}

TEST(OrderWatch, seesThatBothApproachedAtOnce) {
  const Vector3 x = Vector3::UnitX();
  const Vector3 at[] = {-x / 3, 2 * x / 3, -4 * x / 9, 11 * x / 9, 2 * x / 9, 8 * x / 9};
  OrderWatch<double> watch(Vector3::Zero());
  // Masses (1, 2, 1) meet from left to right. The first impact leaves ball 0 at -1/3, ball 1 at
  // 2/3.
  const auto first = [&](double date) {
    return watch.note(date, {0, at[0], 1, 4.0 / 3}, {1, at[1], 0.5, 2.0 / 3}, x, 1, 1, 1);
  };
  // Then ball 1 meets ball 2, which came at -1 and leaves at 11/9 (they approached before), or
  // which rested and leaves at 8/9 (they did not).
  const auto comes = [&](double date) {
    return watch.note(date, {1, at[2], 0.5, 10.0 / 9}, {2, at[3], 1, 20.0 / 9}, x, 5.0 / 3, 1, 1);
  };
  const auto rested = [&](double date) {
    return watch.note(date, {1, at[4], 0.5, 4.0 / 9}, {2, at[5], 1, 8.0 / 9}, x, 2.0 / 3, 1, 1);
  };
  EXPECT_FALSE(first(0));
  EXPECT_TRUE(comes(0));
  EXPECT_FALSE(first(1));
  EXPECT_FALSE(rested(1));
  EXPECT_FALSE(first(2));
  EXPECT_FALSE(comes(2 + 1e-9)) << "later is another instant";
  // The same with the partners of the first impact named the other way round.
  EXPECT_FALSE(
      watch.note(2.5, {1, at[1], 0.5, 2.0 / 3}, {0, at[0], 1, 4.0 / 3}, Vector3(-x), 1, 1, 1));
  EXPECT_TRUE(comes(2.5));
  EXPECT_FALSE(
      watch.note(2.7, {1, at[1], 0.5, 2.0 / 3}, {0, at[0], 1, 4.0 / 3}, Vector3(-x), 1, 1, 1));
  EXPECT_FALSE(rested(2.7));
  EXPECT_FALSE(first(3));
  watch.setBack(1);
  EXPECT_FALSE(comes(3)) << "so is the same reading of a clock that was set back";
}

TEST(Touches, toTheRoundingOfPlaces) {
  EXPECT_TRUE(touches<double>(-1e-3, 1, 0)) << "overlapping";
  EXPECT_TRUE(touches<double>(0.9e-12, 1, 1));
  EXPECT_FALSE(touches<double>(1.1e-12, 1, 1));
  EXPECT_TRUE(touches<double>(1e-10, 1, 1e6)) << "an ulp of 1e6";
  EXPECT_FALSE(touches<double>(1e-8, 1, 1e6));
}

/// A cluster of random bodies and contacts between random pairs, walls among them. Its normals need
/// no geometry: the law holds for any.
struct RandomCluster {
  std::vector<ClusterBody<double>> bodies;
  std::vector<ClusterContact<double>> contacts;

  RandomCluster(RandomNumbers& random, std::size_t balls, std::size_t count, double mass_decades) {
    for (std::size_t i = 0; i < balls; ++i) {
      const double mass = std::pow(10, random.uniform(0, mass_decades));
      bodies.push_back({random.gaussianVector(1), 1 / mass});
    }
    if (balls > 2) bodies[1].w = 0;
    if (balls > 2) bodies[1].v = Vector3::Zero();
    while (contacts.size() < count) {
      ClusterContact<double> contact;
      contact.a = random.index(balls);
      contact.b = random.index(balls + 1);
      if (contact.b == balls) contact.b = ClusterContact<double>::kWall;
      if (contact.a == contact.b || bodies[contact.a].w == 0) continue;
      contact.normal = random.direction();
      contact.reach = 1;
      contacts.push_back(contact);
    }
  }

  long double energy() const {
    long double sum = 0;
    for (const auto& body : bodies) {
      const VectorOf<long double> v = body.v.cast<long double>();
      if (body.w > 0) sum += dot(v, v) / (2 * static_cast<long double>(body.w));
    }
    return sum;
  }
};

TEST(KeepApproaching, takesRoundingForNoApproach) {
  // Ball 1 was stopped by an impact, to the rounding of that impact; ball 2 rests.
  const std::vector<ClusterBody<double>> bodies = {
      {Vector3(1, 0, 0), 1}, {Vector3(2e-16, 0, 0), 1}, {Vector3::Zero(), 1}};
  std::vector<ClusterContact<double>> contacts(2);
  contacts[0].b = 1;
  contacts[1].a = 1;
  contacts[1].b = 2;
  keepApproaching(bodies, contacts);
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].a, 0u);
  EXPECT_EQ(contacts[0].approach_speed, 1 - 2e-16);
}

TEST(ReflectTogether, keepsEnergyAndTheLawInRandomClusters) {
  RandomNumbers random(5);
  std::size_t shared = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const std::size_t balls = 2 + random.index(8);
    RandomCluster cluster(random, balls, 1 + random.index(3 * balls), trial % 3 * 2.0);
    keepApproaching(cluster.bodies, cluster.contacts);
    if (cluster.contacts.empty()) continue;
    if (cluster.contacts.size() > 2) ++shared;
    const double e = trial % 2 == 0 ? 1 : random.uniform(0, 1);
    const auto before = cluster.bodies;
    const long double energy = cluster.energy();
    reflectTogether(cluster.bodies, cluster.contacts, e);
    SCOPED_TRACE("trial " + std::to_string(trial));
    // Velocities are rounded once, at 2^-53 of their size.
    if (e == 1) {
      EXPECT_NEAR(double(cluster.energy() / energy - 1), 0, 1e-14);
    } else {
      EXPECT_LT(double(cluster.energy() / energy - 1), 1e-14);
    }
    long double greatest = 0;
    for (const auto& contact : cluster.contacts) {
      const bool wall = contact.withWall();
      const VectorOf<long double> n = contact.normal.cast<long double>();
      const VectorOf<long double> v_a = cluster.bodies[contact.a].v.cast<long double>();
      const VectorOf<long double> v_b =
          wall ? VectorOf<long double>(VectorOf<long double>::Zero())
               : VectorOf<long double>(cluster.bodies[contact.b].v.cast<long double>());
      const long double parting = dot(v_b, n) - dot(v_a, n);
      const long double surplus = parting - static_cast<long double>(e) * contact.approach_speed;
      greatest = std::max<long double>(greatest, contact.impulse);
      // Each parts with e times its speed of approach, or faster if it took no impulse.
      EXPECT_GE(contact.impulse, 0);
      EXPECT_GT(double(surplus), -1e-12);
      if (contact.impulse > 1e-12) {
        EXPECT_LT(double(surplus), 1e-12);
      }
    }
    // Changes of momentum are the impulses: what goes from ball to ball cancels.
    for (std::size_t i = 0; i < balls; ++i) {
      VectorOf<long double> change =
          cluster.bodies[i].v.cast<long double>() - before[i].v.cast<long double>();
      if (cluster.bodies[i].w == 0) {
        EXPECT_EQ(double(change.norm()), 0);
        continue;
      }
      for (const auto& contact : cluster.contacts) {
        const VectorOf<long double> push =
            static_cast<long double>(contact.impulse) * contact.normal.cast<long double>();
        if (contact.a == i) change += cluster.bodies[i].w * push;
        if (contact.b == i) change -= cluster.bodies[i].w * push;
      }
      EXPECT_LT(double(change.norm()), 1e-14 * double(1 + greatest * cluster.bodies[i].w));
    }
  }
  EXPECT_GT(shared, 200u) << "the clusters test nothing";
}

TEST(ReflectTogether, roundsEndWithNothingApproaching) {
  RandomNumbers random(8);
  for (int trial = 0; trial < 100; ++trial) {
    RandomCluster cluster(random, 8, 14, 0);
    const auto contacts = cluster.contacts;
    const long double energy = cluster.energy();
    int rounds = 0;
    for (; rounds < 1000; ++rounds) {
      cluster.contacts = contacts;
      keepApproaching(cluster.bodies, cluster.contacts);
      if (cluster.contacts.empty()) break;
      reflectTogether(cluster.bodies, cluster.contacts, 1.0);
    }
    EXPECT_LT(rounds, 200) << "trial " << trial;
    EXPECT_NEAR(double(cluster.energy() / energy - 1), 0, 1e-13);
  }
}

// A light ball between two heavy ones that close in: exact in the limit, each speed is turned.
TEST(ReflectTogether, standsAnyRatioOfMasses) {
  for (const double mass : {1e-6, 1e-12, 1e-18}) {
    std::vector<ClusterBody<double>> bodies = {
        {Vector3(1, 0, 0), 1}, {Vector3::Zero(), 1 / mass}, {Vector3(-1, 0, 0), 1}};
    std::vector<ClusterContact<double>> contacts(2);
    contacts[0].b = 1;
    contacts[1].a = 1;
    contacts[1].b = 2;
    keepApproaching(bodies, contacts);
    ASSERT_EQ(contacts.size(), 2u);
    reflectTogether(bodies, contacts, 1.0);
    EXPECT_NEAR(bodies[0].v.x(), -1, 1e-12) << "mass " << mass;
    EXPECT_NEAR(bodies[2].v.x(), 1, 1e-12) << "mass " << mass;
  }
}

// A square of four balls between two jaws holds more contacts than motions: impulses are not
// unique, velocities are.
TEST(ReflectTogether, redundantContactsLeaveTheVelocitiesUnique) {
  const std::vector<ClusterBody<double>> start = {
      {Vector3(1, 0, 0), 1}, {Vector3(-1, 0, 0), 1}, {Vector3(0, 0, 0), 2}};
  const auto contact = [](std::size_t a, std::size_t b, const Vector3& n) {
    ClusterContact<double> c;
    c.a = a;
    c.b = b;
    c.normal = n;
    return c;
  };
  std::vector<ClusterContact<double>> all = {
      contact(0, 1, Vector3::UnitX()),      contact(0, 1, Vector3::UnitX()),
      contact(0, 2, Vector3(0.6, 0.8, 0)),  contact(2, 1, Vector3(0.6, -0.8, 0)),
      contact(0, 2, Vector3(0.6, -0.8, 0)), contact(2, 1, Vector3(0.6, 0.8, 0))};
  std::vector<Vector3> reference;
  std::sort(all.begin(), all.end(), [](const auto& p, const auto& q) {
    return std::make_tuple(p.a, p.b, p.normal.y()) < std::make_tuple(q.a, q.b, q.normal.y());
  });
  for (std::size_t turn = 0; turn < all.size(); ++turn) {
    std::rotate(all.begin(), all.begin() + 1, all.end());
    std::vector<ClusterBody<double>> bodies = start;
    std::vector<ClusterContact<double>> contacts = all;
    keepApproaching(bodies, contacts);
    EXPECT_EQ(contacts.size(), 6u);
    reflectTogether(bodies, contacts, 1.0);
    for (std::size_t i = 0; i < 3; ++i) {
      if (turn == 0) reference.push_back(bodies[i].v);
      EXPECT_LT((bodies[i].v - reference[i]).norm(), 1e-13) << "turn " << turn;
    }
    EXPECT_NEAR(bodies[0].v.x(), -1, 1e-13);
    EXPECT_NEAR(bodies[1].v.x(), 1, 1e-13);
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
