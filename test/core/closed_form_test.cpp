// Motions known in closed form, from first to last second.
#include "support/closed_form.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/methods_under_test.hpp"
#include "support/random_numbers.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

class ClosedForm : public testing::TestWithParam<std::string> {};

TEST_P(ClosedForm, oneBallInABoxIsATriangleFold) {
  RandomNumbers random(5);
  for (int round = 0; round < 10; ++round) {
    TestScene scene;
    scene.surroundings.box.min = Vector3(-1, 0, 2);
    scene.surroundings.box.max = Vector3(1, 3, 2.75);
    const double r = 0.2;
    const Vector3 x(random.uniform(-0.8, 0.8), random.uniform(0.2, 2.8), random.uniform(2.2, 2.5));
    const Vector3 v = random.gaussianVector(3);
    scene.balls = {{x, v, r, 1}};
    Trial run(GetParam(), scene);
    for (double t = 0; t <= 50; t += 0.83) {
      run.advanceTo(t);
      for (int axis = 0; axis < 3; ++axis) {
        const FoldedLine truth(scene.surroundings.box.min[axis] + LongDouble(r),
                               scene.surroundings.box.max[axis] - LongDouble(r), x[axis], v[axis]);
        // Each of up to 2000 impacts rounds a place of 3 m and a date of seconds at 10 m/s: 2e-15
        // m, the same way at worst.
        EXPECT_NEAR(run.position(0)[axis], double(truth.positionAt(t)), 4e-12) << t;
      }
    }
  }
}

TEST_P(ClosedForm, twoBallsOnALineAreSortedFolds) {
  TestScene scene;
  scene.surroundings.box.min.x() = 0;
  scene.surroundings.box.max.x() = 3;
  scene.balls = {{Vector3(0.7, 0, 0), Vector3(1.25, 0, 0), 0.25, 1},
                 {Vector3(2.1, 0, 0), Vector3(-0.75, 0, 0), 0.25, 1}};
  const TwoBallsOnALine truth(0, 3, 0.25, 0.7, 1.25, 2.1, -0.75);
  Trial run(GetParam(), scene);
  for (double t = 0; t <= 60; t += 0.37) {
    run.advanceTo(t);
    const auto [left, right] = truth.positionsAt(t);
    EXPECT_NEAR(run.position(0).x(), double(left), 1e-13) << t;  // some 100 roundings of 3 m
    EXPECT_NEAR(run.position(1).x(), double(right), 1e-13) << t;
  }
}

TEST_P(ClosedForm, elasticBounceGoesOnForEver) {
  const BouncingBall truth(5, 10, 1);
  TestScene scene{floorUnderGravity(10, 1), {{Vector3(0, 0, 5.5), Vector3::Zero(), 0.5, 1}}};
  Trial run(GetParam(), scene);
  for (double t = 0; t <= 200; t += 0.77) {
    run.advanceTo(t);
    EXPECT_NEAR(run.position(0).z() - 0.5, double(truth.heightAt(t)), 1e-11) << t;
  }
  EXPECT_EQ(run.collisions().size(), 100u);
}

TEST_P(ClosedForm, dissipativeBounceFollowsItsSeries) {
  const BouncingBall truth(5, 10, 0.9L);
  TestScene scene{floorUnderGravity(10, 0.9), {{Vector3(0, 0, 5.5), Vector3::Zero(), 0.5, 1}}};
  Trial run(GetParam(), scene);
  for (double t = 0; t <= 17; t += 0.21) {
    run.advanceTo(t);
    EXPECT_NEAR(run.position(0).z() - 0.5, double(truth.heightAt(t)), 1e-12) << t;
  }
}

TEST_P(ClosedForm, contactsOnAnInclinedPlaneComeAtEqualIntervals) {
  const double slope = 0.4;  // rad
  const double g = 9.81;
  const double d = 0.7;  // m, from the surface to the plane
  TestScene scene;
  scene.surroundings.gravity = Vector3(0, 0, -g);
  const Vector3 normal(-std::sin(slope), 0, std::cos(slope));
  scene.surroundings.planes = {{normal, 0}};
  scene.balls = {{(0.1 + d) * normal, Vector3::Zero(), 0.1, 1}};
  Trial run(GetParam(), scene);
  run.advanceTo(20);
  const double interval = 2 * std::sqrt(2 * d / (g * std::cos(slope)));
  ASSERT_EQ(run.collisions().size(), static_cast<std::size_t>(20 / interval + 0.5));
  for (std::size_t i = 0; i < run.collisions().size(); ++i) {
    // The ball is 800 m down in the end, and its place is known to 1e-13 m by then.
    EXPECT_NEAR(run.collisions()[i].time.seconds(), (double(i) + 0.5) * interval, 1e-10) << i;
    EXPECT_EQ(run.collisions()[i].b, planePartner(0));
  }
}

TEST_P(ClosedForm, gravityCancelsBetweenFreeBalls) {
  TestScene flying;
  flying.balls = {{Vector3(0, 0, 0), Vector3(1, 0.1, 2), 0.5, 1},
                  {Vector3(5, 0.3, 1), Vector3(-1, 0, 1.5), 0.5, 3}};
  TestScene falling = flying;
  falling.surroundings.gravity = Vector3(0.5, 0, -10);
  Trial a(GetParam(), flying);
  Trial b(GetParam(), falling);
  a.advanceTo(3);
  b.advanceTo(3);
  ASSERT_EQ(a.collisions().size(), 1u);
  ASSERT_EQ(b.collisions().size(), 1u);
  EXPECT_NEAR(a.collisions()[0].time - b.collisions()[0].time, 0, 1e-14);
  const Vector3 fall = 4.5 * falling.surroundings.gravity;
  for (BallId id = 0; id < 2; ++id) {
    EXPECT_LT((a.position(id) + fall - b.position(id)).norm(), 1e-12);
  }
}

// Two balls that share a line through a periodic box hit each other from both sides in turn, also
// when the free way is a billionth of a diameter.
TEST_P(ClosedForm, twoImagesHitFromBothSides) {
  for (const double free_way : {0.5, 1e-3, 0x1p-26}) {
    TestScene scene;
    scene.surroundings.periodic = true;
    scene.surroundings.box.min = Vector3::Zero();
    scene.surroundings.box.max = Vector3(2 + free_way, 4, 4);
    scene.balls = {{Vector3(0.5, 1, 1), Vector3(0.5, 0, 0), 0.5, 1},
                   {Vector3(1.5 + free_way / 2, 1, 1), Vector3(-0.5, 0, 0), 0.5, 1}};
    Trial run(GetParam(), scene);
    run.advanceTo(20.25 * free_way, 1000);
    EXPECT_EQ(run.collisions().size(), 20u) << "free way " << free_way;
    for (std::size_t i = 0; i < run.collisions().size(); ++i) {
      EXPECT_EQ(run.collisions()[i].normal.x(), i % 2 == 0 ? 1 : -1) << i;
    }
  }
}

// A small ball falls between a fixed ball and its image and touches both at once.
TEST_P(ClosedForm, twoImagesAreHitAtOnce) {
  TestScene scene;
  scene.surroundings.periodic = true;
  scene.surroundings.box.min = Vector3(-0.75, -2, -2);
  scene.surroundings.box.max = Vector3(0.75, 2, 2);
  scene.balls = {{Vector3::Zero(), Vector3::Zero(), 0.7, kFixed},
                 {Vector3(-0.75, 1.5, 0), Vector3(0, -1, 0), 0.55, 1}};
  Trial run(GetParam(), scene);
  // Centres 1 m below: contact with both at y = sqrt(1.25^2 - 0.75^2) = 1, normals (+-3, 4)/5.
  run.advanceTo(0.6, 100);
  ASSERT_EQ(run.collisions().size(), 2u);
  for (const Collision& collision : run.collisions()) {
    EXPECT_NEAR(collision.time.seconds(), 0.5, 1e-14);
    EXPECT_NEAR(collision.normal.y(), 0.8, 1e-14);
  }
  EXPECT_NEAR(run.collisions()[0].normal.x(), -run.collisions()[1].normal.x(), 1e-14);
  // Off the first with (+-24, 7)/25; off the second at 24/25 * 3/5 - 7/25 * 4/5 = 44/125 m/s.
  EXPECT_NEAR(run.collisions()[1].approach_speed, 44.0 / 125, 1e-14);
  EXPECT_NEAR(run.velocity(1).norm(), 1, 1e-14);
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, ClosedForm, testing::ValuesIn(exactMethods()), methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
