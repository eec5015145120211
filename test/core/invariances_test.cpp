// What physics does not notice: where one stands, which way one looks, how fast one goes, how balls
// are numbered, how large and how heavy the unit is, when one begins, and which way time runs.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "support/methods_under_test.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

/// A cluster in open space: nothing singles out a place or a direction.
TestScene cluster(std::uint64_t seed) {
  SceneKind kind;
  kind.boundary = Boundary::open;
  kind.count = 20;
  kind.largest_radius = 0.12;
  kind.size_ratio = 3;
  kind.mass_ratio = 10;
  TestScene scene = randomScene(kind, seed);
  for (Ball& ball : scene.balls) {  // fly inwards, so that they meet
    ball.velocity = 0.2 * ball.velocity + 2 * (Vector3::Constant(0.5) - ball.position);
  }
  return scene;
}

/// A closed box of balls of many sizes.
TestScene gas(std::uint64_t seed) {
  SceneKind kind;
  kind.count = 20;
  kind.size_ratio = 4;
  kind.mass_ratio = 10;
  return randomScene(kind, seed);
}

constexpr double kDuration = 0.6;  // s, a few impacts a ball: far below the horizon of chaos
// After a few impacts a ball, each of which makes rounding grow tenfold or so.
constexpr double kGrownRounding = 1e-9;

class Invariance : public testing::TestWithParam<std::string> {
 protected:
  BallStates after(const TestScene& scene, double seconds, std::size_t* impacts = nullptr) {
    Trial run(GetParam(), scene);
    run.advanceTo(seconds);
    if (impacts != nullptr) *impacts = run.collisions().size();
    return run.states();
  }
};

TEST_P(Invariance, galileanShift) {
  const Vector3 wind(3, -2, 1);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const TestScene scene = cluster(seed);
    TestScene moving = scene;
    for (Ball& ball : moving.balls) ball.velocity += wind;
    std::size_t impacts = 0, impacts_moving = 0;
    const BallStates a = after(scene, kDuration, &impacts);
    const BallStates b = after(moving, kDuration, &impacts_moving);
    ASSERT_EQ(impacts, impacts_moving) << "seed " << seed;
    ASSERT_GT(impacts, 5u);
    for (std::size_t i = 0; i < a.ids.size(); ++i) {
      EXPECT_LT((a.positions[i] + kDuration * wind - b.positions[i]).norm(), kGrownRounding);
      EXPECT_LT((a.velocities[i] + wind - b.velocities[i]).norm(), kGrownRounding);
    }
  }
}

TEST_P(Invariance, rotation) {
  Eigen::Matrix3d turn;
  turn << 2, -1, 2, 2, 2, -1, -1, 2, 2;
  turn /= 3;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const TestScene scene = cluster(seed);
    TestScene turned = scene;
    for (Ball& ball : turned.balls) {
      ball.position = turn * ball.position;
      ball.velocity = turn * ball.velocity;
    }
    const BallStates a = after(scene, kDuration);
    const BallStates b = after(turned, kDuration);
    for (std::size_t i = 0; i < a.ids.size(); ++i) {
      EXPECT_LT((turn * a.positions[i] - b.positions[i]).norm(), kGrownRounding) << seed;
      EXPECT_LT((turn * a.velocities[i] - b.velocities[i]).norm(), kGrownRounding) << seed;
    }
  }
}

TEST_P(Invariance, permutationBitForBit) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const TestScene scene = gas(seed);
    const std::size_t count = scene.balls.size();
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < count; ++i) order.push_back((7 * i + seed) % count);
    std::sort(order.begin(), order.end());
    RandomNumbers random(seed);
    for (std::size_t i = count - 1; i > 0; --i) std::swap(order[i], order[random.index(i + 1)]);
    TestScene shuffled = scene;
    for (std::size_t i = 0; i < count; ++i) shuffled.balls[i] = scene.balls[order[i]];
    const BallStates a = after(scene, 2);
    const BallStates b = after(shuffled, 2);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(a.positions[order[i]], b.positions[i]) << "seed " << seed;
      EXPECT_EQ(a.velocities[order[i]], b.velocities[i]) << "seed " << seed;
    }
  }
}

TEST_P(Invariance, scaleByPowersOfTwoBitForBit) {
  for (const double scale : {0x1p-20, 0x1p+30}) {
    const TestScene scene = gas(3);
    TestScene large = scene;
    large.surroundings.box.min *= scale;
    large.surroundings.box.max *= scale;
    for (Ball& ball : large.balls) {
      ball.position *= scale;
      ball.radius *= scale;
      ball.mass *= 8;
    }
    Trial a(GetParam(), scene);
    Trial b(GetParam(), large);
    a.advanceTo(1);
    b.advanceTo(scale);
    ASSERT_EQ(a.collisions().size(), b.collisions().size());
    for (std::size_t i = 0; i < a.collisions().size(); ++i) {
      EXPECT_EQ(a.collisions()[i].b, b.collisions()[i].b);
      EXPECT_EQ(a.collisions()[i].normal, b.collisions()[i].normal);
    }
    for (BallId id = 0; id < scene.balls.size(); ++id) {
      EXPECT_EQ(a.velocity(id), b.velocity(id)) << scale;
      // The date of the end is counted in seconds and not in the scene's unit: a few ulp.
      EXPECT_LT((scale * a.position(id) - b.position(id)).norm(), 1e-14 * scale) << scale;
    }
  }
}

TEST_P(Invariance, planarStaysPlanarBitForBit) {
  for (const SceneKind& kind : sceneKinds()) {
    if (!kind.planar || kind.gravity > 0) continue;
    TestScene scene = randomScene(kind, 9);
    // Without a box of no height too: it is the arithmetic that keeps the plane.
    if (kind.boundary == Boundary::closed) {
      scene.surroundings.box.min.z() = -10;
      scene.surroundings.box.max.z() = 10;
    }
    const BallStates states = after(scene, kind.simulated_time);
    for (std::size_t i = 0; i < states.ids.size(); ++i) {
      EXPECT_EQ(states.positions[i].z(), 0) << kind.name;
      EXPECT_EQ(states.velocities[i].z(), 0) << kind.name;
    }
  }
}

TEST_P(Invariance, timeReversalLeadsBack) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const TestScene scene = gas(seed);
    Trial run(GetParam(), scene);
    run.advanceTo(kDuration);
    ASSERT_GT(run.collisions().size(), 10u);
    const BallStates there = run.states();
    for (std::size_t i = 0; i < there.ids.size(); ++i) {
      run.method().setVelocity(there.ids[i], -there.velocities[i]);
    }
    run.advanceTo(2 * kDuration);
    for (std::size_t i = 0; i < scene.balls.size(); ++i) {
      const BallId id = static_cast<BallId>(i);
      EXPECT_LT((run.position(id) - scene.balls[i].position).norm(), kGrownRounding) << seed;
      EXPECT_LT((run.velocity(id) + scene.balls[i].velocity).norm(), kGrownRounding) << seed;
    }
  }
}

TEST_P(Invariance, startClockAtZeroOrAtTwoToTheThirty) {
  for (const double start : {0x1p30, 1e9}) {
    const TestScene scene = gas(4);
    Trial early(GetParam(), scene);
    early.advanceTo(kDuration);
    Trial late(GetParam(), {scene.surroundings, {}});
    late.advanceTo(start);
    for (std::size_t i = 0; i < scene.balls.size(); ++i) {
      late.method().insert(static_cast<BallId>(i), scene.balls[i]);
    }
    const Time end = Time::fromSeconds(start) + kDuration;
    ASSERT_TRUE(late.method().advanceTo(end, 1000000));
    ASSERT_EQ(early.collisions().size(), late.collisions().size());
    for (std::size_t i = 0; i < early.collisions().size(); ++i) {
      EXPECT_EQ(early.collisions()[i].a, late.collisions()[i].a);
      EXPECT_EQ(early.collisions()[i].b, late.collisions()[i].b);
      // Not the 1e-7 s that a clock in a plain double would leave.
      EXPECT_NEAR(late.collisions()[i].time - Time::fromSeconds(start),
                  early.collisions()[i].time.seconds(), 1e-14);
    }
    for (BallId id = 0; id < scene.balls.size(); ++id) {
      EXPECT_LT((early.position(id) - late.position(id)).norm(), kGrownRounding);
    }
  }
}

TEST_P(Invariance, farFromTheOriginOnlyTheUnitOfTheLastPlaceCounts) {
  const double far = 1e6;
  const TestScene scene = cluster(2);
  TestScene shifted = scene;
  for (Ball& ball : shifted.balls) ball.position.x() += far;
  std::size_t impacts = 0, impacts_far = 0;
  const BallStates a = after(scene, kDuration, &impacts);
  const BallStates b = after(shifted, kDuration, &impacts_far);
  ASSERT_EQ(impacts, impacts_far);
  for (std::size_t i = 0; i < a.ids.size(); ++i) {
    // 10 ulp(1e6) = 1.2e-9, times a growth of 1e3 over a few impacts.
    EXPECT_LT((a.positions[i] + Vector3(far, 0, 0) - b.positions[i]).norm(), 1.2e-6);
  }
}

TEST_P(Invariance, energyAndMomentumOfAGas) {
  TestScene scene = cluster(6);
  const BallStates states = after(scene, 5);
  const BallStates start = after(scene, 0);
  const auto energy = kineticEnergyOf(scene, start);
  EXPECT_NEAR(double(kineticEnergyOf(scene, states) / energy), 1, 1e-14);
  EXPECT_LT(double((momentumOf(scene, states) - momentumOf(scene, start)).norm()), 1e-13);
}

TEST_P(Invariance, reversalErrorGrowsAsChaosHasIt) {
  // Return error grows by a factor per impact and ball; far below the horizon it is rounding,
  // beyond it the size of the box.
  const TestScene scene = gas(7);
  double before = 0;
  for (const double duration : {0.2, 0.8, 3.2}) {
    Trial run(GetParam(), scene);
    run.advanceTo(duration);
    const BallStates there = run.states();
    for (std::size_t i = 0; i < there.ids.size(); ++i) {
      run.method().setVelocity(there.ids[i], -there.velocities[i]);
    }
    run.advanceTo(2 * duration);
    double error = 1e-17;
    for (std::size_t i = 0; i < scene.balls.size(); ++i) {
      const BallId id = static_cast<BallId>(i);
      error = std::max(error, (run.position(id) - scene.balls[i].position).norm());
    }
    const double impacts_per_ball =
        2.0 * double(run.collisions().size()) / double(scene.balls.size());
    // At most 6 bits per impact and ball in this dilute box (3.3 at rho = 0.1, small balls more).
    EXPECT_LT(std::log2(error / 1e-15), 6 * impacts_per_ball) << duration;
    EXPECT_GE(error, before / 100) << duration;
    before = error;
  }
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, Invariance, testing::ValuesIn(exactMethods()), methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
