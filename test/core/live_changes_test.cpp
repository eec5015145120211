// Balls that are inserted, removed, pushed and moved while the others fly, at exact times.
#include <gtest/gtest.h>

#include "support/methods_under_test.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

class LiveChanges : public testing::TestWithParam<std::string> {
 protected:
  /// Ball 0 flies along x at 1 m/s towards ball 1 at rest: contact at t = 4.
  static TestScene two() {
    TestScene scene;
    scene.balls = {{Vector3(0, 0, 0), Vector3(1, 0, 0), 0.5, 1},
                   {Vector3(5, 0, 0), Vector3::Zero(), 0.5, 1}};
    return scene;
  }
};

TEST_P(LiveChanges, aBallPutInTheWayIsHit) {
  Trial run(GetParam(), two());
  run.advanceTo(1);
  run.method().insert(7, {Vector3(3, 0, 0), Vector3::Zero(), 0.5, 1});
  run.advanceTo(10);
  ASSERT_EQ(run.collisions().size(), 2u);
  EXPECT_EQ(run.collisions()[0].time.seconds(), 2);
  EXPECT_EQ(run.collisions()[0].b, 7);
  EXPECT_EQ(run.collisions()[1].time.seconds(), 3);
  EXPECT_EQ(run.collisions()[1].a, 1u);
  EXPECT_EQ(run.collisions()[1].b, 7);
  EXPECT_EQ(run.velocity(1), Vector3(1, 0, 0));
}

TEST_P(LiveChanges, aRemovedBallIsNotHit) {
  Trial run(GetParam(), two());
  run.advanceTo(3.5);
  run.method().remove(1);
  run.advanceTo(10);
  EXPECT_TRUE(run.collisions().empty());
  EXPECT_EQ(run.position(0), Vector3(10, 0, 0));
  EXPECT_EQ(run.states().ids, std::vector<BallId>{0});
}

TEST_P(LiveChanges, whoLosesItsPartnerToANewBallGoesOn) {
  TestScene scene;  // ball 2 flies towards ball 0, and ball 1 stands behind that
  scene.balls = {{Vector3(5, 0, 0), Vector3::Zero(), 0.5, 1},
                 {Vector3(10, 0, 0), Vector3::Zero(), 0.5, 1},
                 {Vector3(0, 0, 0), Vector3(1, 0, 0), 0.5, 1}};
  Trial run(GetParam(), scene);
  run.advanceTo(3.999);  // so near that the impact, at 4, is in the queue's bucket at hand
  run.method().remove(0);
  run.method().insert(3, {Vector3(0, 5, 0), Vector3::Zero(), 0.5, 1});
  run.advanceTo(20);
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_EQ(run.collisions()[0].time.seconds(), 9);
  EXPECT_EQ(run.collisions()[0].a, 1u);
}

TEST_P(LiveChanges, aRemovedAndReplacedBallIsNotConfused) {
  Trial run(GetParam(), two());
  run.advanceTo(3.5);
  run.method().remove(1);
  run.method().insert(2, {Vector3(8, 0, 0), Vector3::Zero(), 0.5, 1});  // may take its place inside
  run.advanceTo(10);
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_EQ(run.collisions()[0].b, 2);
  EXPECT_EQ(run.collisions()[0].time.seconds(), 7);
}

TEST_P(LiveChanges, aPushActsFromItsInstantOn) {
  Trial run(GetParam(), two());
  run.advanceTo(2);
  run.method().setVelocity(1, Vector3(-1, 0, 0));
  EXPECT_EQ(run.velocity(1), Vector3(-1, 0, 0));
  run.advanceTo(10);
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_EQ(run.collisions()[0].time.seconds(), 3);
  EXPECT_EQ(run.position(0), Vector3(3 - 7, 0, 0));
  EXPECT_EQ(run.position(1), Vector3(4 + 7, 0, 0));
}

TEST_P(LiveChanges, aPushAtTheInstantOfAnImpactComesAfterIt) {
  Trial run(GetParam(), two());
  run.advanceTo(4);  // what happens up to and at 4 has happened
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_EQ(run.velocity(1), Vector3(1, 0, 0));
  run.method().setVelocity(1, Vector3(-1, 0, 0));  // back into ball 0, which it touches
  run.advanceTo(4.5);
  ASSERT_EQ(run.collisions().size(), 2u);
  EXPECT_EQ(run.collisions()[1].time.seconds(), 4);
  EXPECT_EQ(run.velocity(0), Vector3(-1, 0, 0));
}

TEST_P(LiveChanges, aMovedBallIsSomewhereElse) {
  Trial run(GetParam(), two());
  run.advanceTo(2);
  run.method().setMotion(1, Vector3(2, 3, 0), Vector3(0, -1, 0));
  run.advanceTo(3);
  EXPECT_EQ(run.position(1), Vector3(2, 2, 0));
  run.method().setMotion(1, Vector3(1000, 0, 0), Vector3::Zero());  // far outside of what was
  run.advanceTo(2000);
  ASSERT_EQ(run.collisions().size(), 1u);
  EXPECT_NEAR(run.collisions()[0].time.seconds(), 999, 1e-12);  // a few ulp of 999
}

TEST_P(LiveChanges, anEmptyMethodKeepsTime) {
  Trial run(GetParam(), TestScene{});
  run.advanceTo(12.5);
  EXPECT_EQ(run.method().now(), Time::fromSeconds(12.5));
  run.method().insert(0, {Vector3::Zero(), Vector3(2, 0, 0), 0.5, 1});
  run.advanceTo(13);
  EXPECT_EQ(run.position(0), Vector3(1, 0, 0));
  run.method().remove(0);
  run.advanceTo(14);
  EXPECT_EQ(run.method().now(), Time::fromSeconds(14));
  EXPECT_TRUE(run.states().ids.empty());
}

TEST_P(LiveChanges, overlapIsFoundWhereTheBallsAreNow) {
  Trial run(GetParam(), two());
  run.advanceTo(1.5);
  const Method& method = run.method();
  EXPECT_EQ(method.findOverlap(Vector3(1.5, 0.9, 0), 0.5, std::nullopt), BallId{0});
  EXPECT_EQ(method.findOverlap(Vector3(1.5, 0.9, 0), 0.5, BallId{0}), std::nullopt);
  EXPECT_EQ(method.findOverlap(Vector3(1.5, 1, 0), 0.5, std::nullopt), std::nullopt) << "touches";
  EXPECT_EQ(method.findOverlap(Vector3(0, 0, 0), 0.5, std::nullopt), std::nullopt) << "has left";
  EXPECT_EQ(method.findOverlap(Vector3(3, 0, 0), 2, std::nullopt), BallId{0}) << "the smaller id";
}

TEST_P(LiveChanges, overlapIsFoundThroughThePeriodicFaces) {
  TestScene scene;
  scene.surroundings.periodic = true;
  scene.surroundings.box = {Vector3(0, 0, 0), Vector3(4, 4, 4)};
  scene.balls = {{Vector3(3.9, 3.9, 0.1), Vector3::Zero(), 0.5, 1}};
  Trial run(GetParam(), scene);
  EXPECT_EQ(run.method().findOverlap(Vector3(0.3, 0.3, 3.9), 0.5, std::nullopt), BallId{0});
  EXPECT_EQ(run.method().findOverlap(Vector3(2, 2, 2), 0.5, std::nullopt), std::nullopt);
}

/// A random gas, and the same steps with or without looking and stopping in between.
TEST_P(LiveChanges, readingAndStoppingForEventsChangeNoBit) {
  for (const SceneKind& kind : sceneKinds()) {
    if (kind.simulated_time < 1 || kind.restitution < 1 || kind.fixed > 0) continue;
    const TestScene scene = randomScene(kind, 11);
    Trial quiet(GetParam(), scene);
    Trial watched(GetParam(), scene);
    for (double t = 0.1; t < 1; t += 0.1) {
      quiet.advanceTo(t);
      while (!watched.method().advanceTo(Time::fromSeconds(t), 3)) watched.states();
      watched.method().findOverlap(Vector3::Zero(), 0.1, std::nullopt);
      watched.method().ball(0);
    }
    const BallStates a = quiet.states();
    const BallStates b = watched.states();
    EXPECT_EQ(a.positions, b.positions) << kind.name;
    EXPECT_EQ(a.velocities, b.velocities) << kind.name;
  }
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, LiveChanges, testing::ValuesIn(exactMethods()), methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
