// Walls: which there are, what rests on them, and what balls on them do under gravity.
#include "ball_sim/walls.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/methods_under_test.hpp"
#include "support/random_numbers.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

TEST(WallsOf, countsClosedFacesAndPlanes) {
  Surroundings around;
  EXPECT_TRUE(wallsOf<double>(around).empty());
  around.box.min = Vector3(-1, -2, -3);
  around.box.max.x() = 4;
  around.planes = {{Vector3::UnitY(), 0.5}};
  const auto walls = wallsOf<double>(around);
  ASSERT_EQ(walls.size(), 5u);
  const Partner partners[] = {-1, -2, -3, -5, -7};
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(walls[i].partner, partners[i]);
  EXPECT_EQ(walls[1].normal, Vector3(-1, 0, 0));
  EXPECT_EQ(walls[1].offset, -4);
  around.box.max = -around.box.min;
  around.periodic = true;
  EXPECT_EQ(wallsOf<double>(around).size(), 1u);
  EXPECT_EQ(wallsOf<double>(planarSpace()).size(), 0u);
}

class ConstrainedAcceleration : public testing::Test {
 protected:
  Vector3 onWalls(const std::vector<Vector3>& normals, const Vector3& gravity) {
    std::vector<Wall<double>> walls;
    RestingContacts contacts;
    for (std::size_t i = 0; i < normals.size(); ++i) {
      walls.push_back({normals[i].normalized(), 0, planePartner(i)});
      contacts.add(static_cast<int>(i));
    }
    return constrainedAcceleration<double>(gravity, walls, contacts);
  }
  const Vector3 down_{0, 0, -10};
};

TEST_F(ConstrainedAcceleration, freeOnFloorAndSlope) {
  EXPECT_EQ(onWalls({}, down_), down_);
  EXPECT_LT(onWalls({Vector3(0, 0, 1)}, down_).norm(), 1e-14);
  // Slope of 30 degrees: g sin a along it.
  const double a = std::acos(-1) / 6;
  const Vector3 slide = onWalls({Vector3(-std::sin(a), 0, std::cos(a))}, down_);
  EXPECT_LT((slide - 5 * Vector3(-std::cos(a), 0, -std::sin(a))).norm(), 1e-14);
}

TEST_F(ConstrainedAcceleration, vGrooveAndCorner) {
  EXPECT_LT(onWalls({Vector3(1, 0, 1), Vector3(-1, 0, 1)}, down_).norm(), 1e-14);
  // A groove that falls along y: slides along the edge only.
  const Vector3 slide = onWalls({Vector3(1, -0.5, 1), Vector3(-1, -0.5, 1)}, down_);
  EXPECT_NEAR(slide.x(), 0, 1e-14);
  EXPECT_NEAR(slide.y(), -4, 1e-14);  // along (0, -2, -1)/sqrt(5): g/sqrt(5) of it
  EXPECT_NEAR(slide.z(), -2, 1e-14);
  const std::vector<Vector3> corner = {{1, 0, 1}, {-1, 1, 1}, {-1, -1, 1}};
  EXPECT_LT(onWalls(corner, down_).norm(), 1e-14);
}

TEST_F(ConstrainedAcceleration, anOverhangHoldsNothingByItself) {
  EXPECT_EQ(onWalls({Vector3(0, 0, -1)}, down_), down_);
  EXPECT_EQ(onWalls({Vector3(1, 0, -1)}, down_), down_);
  // A slope that leads under an overhang: stuck, though the overhang alone would not hold.
  EXPECT_LT(onWalls({Vector3(-0.2, 0, 1), Vector3(1, 0, -0.1)}, down_).norm(), 1e-14);
}

// The solution is the point of a convex cone nearest to gravity; then no direction in the cone
// from it leads nearer.
TEST_F(ConstrainedAcceleration, isNearestToGravity) {
  RandomNumbers random(3);
  for (int i = 0; i < 500; ++i) {
    std::vector<Vector3> normals;
    for (std::size_t k = 0; k < 1 + random.index(3); ++k) normals.push_back(random.direction());
    const Vector3 a = onWalls(normals, down_);
    for (const Vector3& n : normals) ASSERT_GE(dot(a, n), -1e-10) << i;
    for (int k = 0; k < 200; ++k) {
      const Vector3 other = a + 0.3 * random.gaussianVector(1);
      bool allowed = true;
      for (const Vector3& n : normals) allowed = allowed && dot(other, n) >= 0;
      if (!allowed) continue;
      ASSERT_GE((other - down_).norm(), (a - down_).norm() - 1e-9) << i;
    }
  }
}

class RestingBalls : public testing::TestWithParam<std::string> {
 protected:
  static constexpr double kG = 10;
  /// A ball that has come to rest on the floor at t = 5 s.
  static TestScene droppedBall() {
    return {floorUnderGravity(kG, 0.5), {{Vector3(0, 0, 0.5), Vector3(0.25, 0, 0), 0.1, 1}}};
  }
};

TEST_P(RestingBalls, slideOnWithoutFriction) {
  Trial run(GetParam(), droppedBall());
  run.advanceTo(5, 1000);
  const std::size_t impacts = run.collisions().size();
  run.advanceTo(105, 1000);
  EXPECT_EQ(run.collisions().size(), impacts);
  EXPECT_NEAR(run.position(0).x(), 0.25 * 105, 1e-12);
  EXPECT_NEAR(run.position(0).z(), 0.1, 1e-14);
  EXPECT_EQ(run.velocity(0).z(), 0);
}

TEST_P(RestingBalls, flyAfterAKickUp) {
  Trial run(GetParam(), droppedBall());
  run.advanceTo(5, 1000);
  run.method().setVelocity(0, Vector3(0, 0, 5));
  run.advanceTo(5.5, 1000);
  EXPECT_NEAR(run.position(0).z() - 0.1, 1.25, 1e-13);  // v t - g t^2 / 2
  run.advanceTo(20, 1000);
  EXPECT_NEAR(run.position(0).z(), 0.1, 1e-14);
}

TEST_P(RestingBalls, stayDownAfterAKickSideways) {
  Trial run(GetParam(), droppedBall());
  run.advanceTo(5, 1000);
  run.method().setVelocity(0, Vector3(0, 3, 0));
  run.advanceTo(6, 1000);
  EXPECT_NEAR(run.position(0).y(), 3, 1e-14);
  EXPECT_NEAR(run.position(0).z(), 0.1, 1e-14);
}

TEST_P(RestingBalls, bounceAfterAKickDown) {
  Trial run(GetParam(), droppedBall());
  run.advanceTo(5, 1000);
  const std::size_t impacts = run.collisions().size();
  run.method().setVelocity(0, Vector3(0, 0, -4));
  run.advanceTo(5.1, 1000);
  ASSERT_GT(run.collisions().size(), impacts);
  EXPECT_EQ(run.collisions()[impacts].time, Time::fromSeconds(5));
  EXPECT_NEAR(run.position(0).z() - 0.1, 2 * 0.1 - 5 * 0.01, 1e-13);  // leaves at e 4 m/s
}

TEST_P(RestingBalls, areHitAndHitOthers) {
  TestScene scene = droppedBall();
  scene.surroundings.restitution = 0.5;
  scene.balls[0].velocity = Vector3::Zero();
  scene.balls.push_back({Vector3(-3, 0, 0.1), Vector3(1, 0, 0), 0.1, 1});  // rolls along the floor
  Trial run(GetParam(), scene);
  run.advanceTo(10, 2000);
  // Head on at rest height: (1 + e)/2 of the speed goes over.
  EXPECT_NEAR(run.velocity(0).x(), 0.75, 1e-12);
  EXPECT_NEAR(run.velocity(1).x(), 0.25, 1e-12);
  EXPECT_NEAR(run.position(0).z(), 0.1, 1e-12);
  EXPECT_NEAR(run.position(1).z(), 0.1, 1e-12);
}

TEST_P(RestingBalls, mindNothingWhenNeighboursComeAndGo) {
  Trial run(GetParam(), droppedBall());
  run.advanceTo(5, 1000);
  run.method().insert(1, {Vector3(0.25 * 5 + 0.5, 0, 0.1), Vector3::Zero(), 0.1, 1});
  run.advanceTo(5.5, 2000);
  run.method().remove(1);
  run.advanceTo(10, 2000);
  EXPECT_NEAR(run.position(0).x(), 2.5, 1e-12);
  EXPECT_NEAR(run.position(0).z(), 0.1, 1e-14);
}

TEST_P(RestingBalls, slideDownAnInclinedPlane) {
  const double a = 0.3;
  TestScene scene;
  scene.surroundings.gravity = Vector3(0, 0, -kG);
  scene.surroundings.restitution = 0.4;
  const Vector3 n(-std::sin(a), 0, std::cos(a));
  scene.surroundings.planes = {{n, 0}};
  scene.balls = {{0.1 * n, Vector3::Zero(), 0.1, 1}};
  Trial run(GetParam(), scene);
  run.advanceTo(10, 1000);
  const double way = kG * std::sin(a) * 50;
  EXPECT_LT((run.position(0) - 0.1 * n - way * Vector3(-std::cos(a), 0, -std::sin(a))).norm(),
            1e-10);  // 150 m of rounding
}

TEST_P(RestingBalls, stayInGroovesCornersAndUnderOverhangs) {
  const std::vector<std::vector<Vector3>> hollows = {
      {{1, 0, 1}, {-1, 0, 1}},                  // right-angled groove, level along y
      {{2, 0, 1}, {-2, 0, 1}},                  // narrow groove: its walls push into each other
      {{1, 0.3, 1}, {-1, 0.2, 1}, {0, -1, 1}},  // tip of an upside-down pyramid
      {{-0.2, 0, 1}, {1, 0, -0.1}},             // under an overhang
      {{1, 0, 1}, {-1, 0, 1}, {0, 1, 1}, {0, -1, 1}}};  // four walls, one more than needed
  for (std::size_t i = 0; i < hollows.size(); ++i) {
    for (const double e : {0.0, 0.3, 0.6}) {
      TestScene scene;
      scene.surroundings.gravity = Vector3(0, 0, -kG);
      scene.surroundings.restitution = e;
      for (const Vector3& n : hollows[i]) scene.surroundings.planes.push_back({n.normalized(), 0});
      // Well inside, with a push; grooves are level along y, so nothing is lost that way.
      const Vector3 start = i == 3 ? Vector3(0.5, 0, 0.4) : Vector3(0.01, 0, 1);
      scene.balls = {{start, Vector3(0.2, 0, 0), 0.1, 1}};
      Trial run(GetParam(), scene);
      run.advanceTo(20, 20000);
      const Vector3 place = run.position(0);
      run.advanceTo(120, 20000);
      EXPECT_LT((run.position(0) - place).norm(), 1e-9) << "hollow " << i << ", e = " << e;
      for (const Plane& plane : scene.surroundings.planes) {
        EXPECT_GT(dot(plane.normal, run.position(0)), 0.1 - 1e-9) << i << ", e = " << e;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, RestingBalls, testing::ValuesIn(exactMethods()), methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
