// The broad phase of the stepping methods names every pair that may touch, and each once.
#include "stepping/near_pairs.hpp"

#include <gtest/gtest.h>

#include <set>

#include "ball_sim/ball_check.hpp"
#include "support/random_scenes.hpp"

namespace ball_sim::core {
namespace test {
namespace {

using Pair = std::pair<std::uint32_t, std::uint32_t>;

struct Balls {
  std::vector<SteppedBall> all;
  std::vector<Slot> movers;
  std::vector<Slot> still;

  explicit Balls(const TestScene& scene) {
    for (const Ball& ball : scene.balls) {
      SteppedBall stepped;
      stepped.x = ball.position;
      stepped.v = ball.velocity;
      stepped.radius = ball.radius;
      stepped.w = 1 / ball.mass;
      (stepped.w > 0 ? movers : still).push_back(static_cast<Slot>(all.size()));
      all.push_back(stepped);
    }
  }
};

// Pairs of which one moves whose surfaces are nearer than `margin`, by looking at all.
std::set<Pair> nearOnes(const Balls& balls, const Surroundings& around, double margin) {
  std::set<Pair> found;
  const auto walls = wallsOf<double>(around);
  for (const Slot a : balls.movers) {
    const SteppedBall& ball = balls.all[a];
    for (std::uint32_t b = 0; b < balls.all.size(); ++b) {
      const SteppedBall& other = balls.all[b];
      if (b == a || (other.w > 0 && b < a)) continue;
      const double distance = separation(ball.x, other.x, around).norm();
      if (distance < ball.radius + other.radius + margin) found.emplace(a, b);
    }
    for (std::uint32_t k = 0; k < walls.size(); ++k) {
      const double distance = dot(ball.x, walls[k].normal) - walls[k].offset;
      if (distance < ball.radius + margin) found.emplace(a, kFirstWall + k);
    }
  }
  return found;
}

std::set<Pair> named(const NearPairs& near) {
  std::set<Pair> pairs;
  for (const NearPair& pair : near.pairs()) {
    EXPECT_TRUE(pairs.emplace(pair.a, pair.b).second) << pair.a << " " << pair.b << " twice";
  }
  return pairs;
}

TEST(NearPairs, NamesEveryPairThatTouchesUntilItIsNotGoodAnyMore) {
  for (const SceneKind& kind : sceneKinds()) {
    if (kind.name.rfind("tiny", 0) == 0) continue;  // smaller boxes than its limits allow
    SCOPED_TRACE(kind.name);
    const TestScene scene = randomScene(kind, 5);
    Balls balls(scene);
    NearPairs near(scene.surroundings);
    RandomNumbers random(6);
    int lists = 0;
    for (int step = 0; step < 60; ++step) {
      const double distance = 0.01 * kind.largest_radius;
      if (!near.isGood()) {
        near.list(balls.all, balls.movers, balls.still, distance, 0.001);
        ++lists;
      }
      const std::set<Pair> have = named(near);
      for (const Pair& pair : nearOnes(balls, scene.surroundings, 0.001)) {
        EXPECT_EQ(have.count(pair), 1u) << pair.first << " " << pair.second << " in " << step;
      }
      for (const Slot slot : balls.movers) {
        Vector3 way = distance * random.direction();
        if (kind.planar) way.z() = 0;
        balls.all[slot].x += way;
      }
      near.noteMove(distance);
    }
    EXPECT_GT(lists, 2);
    EXPECT_LT(lists, 30);
  }
}

TEST(NearPairs, BetweenPointsToTheImageThatIsNear) {
  TestScene scene;
  scene.surroundings.periodic = true;
  scene.surroundings.box = {Vector3::Zero(), Vector3::Constant(4)};
  scene.balls = {{Vector3(3.9, 3.9, 0.1), Vector3::Zero(), 0.5, 1},
                 {Vector3(0.1, 0.1, 3.9), Vector3::Zero(), 0.5, 1}};
  Balls balls(scene);
  NearPairs near(scene.surroundings);
  near.list(balls.all, balls.movers, balls.still, 0.001, 0);
  ASSERT_EQ(near.pairs().size(), 1u);
  const Vector3 between = near.between(near.pairs()[0], balls.all[0], balls.all[1]);
  EXPECT_NEAR((between - Vector3(0.2, 0.2, -0.2)).norm(), 0, 1e-15);
}

TEST(NearPairs, RemembersContactsWhoeverMoves) {
  TestScene scene;
  scene.balls = {{Vector3::Zero(), Vector3::Zero(), 0.5, 1},
                 {Vector3(1, 0, 0), Vector3::Zero(), 0.5, 1},
                 {Vector3(0, 1, 0), Vector3::Zero(), 0.5, 1}};
  Balls balls(scene);
  NearPairs near(scene.surroundings);
  near.list(balls.all, {0, 1, 2}, {}, 0.001, 0.001);
  ASSERT_EQ(near.pairs().size(), 2u);
  for (NearPair& pair : near.pairs()) {
    pair.touching = pair.b == 1;
    pair.impulse = 3;
  }
  near.list(balls.all, {2}, {0, 1}, 0.001, 0.001);  // not listed at all
  near.list(balls.all, {1, 2}, {0}, 0.001, 0.001);  // now under ball 1
  ASSERT_EQ(near.pairs().size(), 2u);
  for (const NearPair& pair : near.pairs()) {
    EXPECT_EQ(pair.touching, pair.a == 1);
    EXPECT_EQ(pair.impulse, pair.a == 1 ? 3 : 0);
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
