// The collision law against rational arithmetic, conservation, and inputs of any size.
#include "ball_sim/collision_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

TEST(CollisionLaw, obliqueUnequalInSpaceIsRational) {
  Vector3 v1(3, -1, 2);
  Vector3 v2(-1, 2, -3);
  const Vector3 n = Vector3(2, 3, 6) / 7;
  collide<double>(v1, 1 / 2.0, v2, 1 / 5.0, n, 1.0);
  // A handful of roundings of numbers up to 4.
  EXPECT_LT((v1 - Vector3(449, -1213, -1054) / 343).norm(), 20 * kEps);
  EXPECT_LT((v2 - Vector3(-111, 1034, -333) / 343).norm(), 20 * kEps);
  EXPECT_LT((2 * v1 + 5 * v2 - Vector3(1, 8, -11)).norm(), 100 * kEps);
  EXPECT_NEAR(v1.squaredNorm() + 2.5 * v2.squaredNorm(), 49, 200 * kEps);
}

TEST(CollisionLaw, obliqueEqualInThePlaneIsRational) {
  Vector3 v1(5, 0, 0);
  Vector3 v2(0, 0, 0);
  const auto passed = collide<double>(v1, 1.0, v2, 1.0, Vector3(4, 3, 0) / 5, 1.0);
  EXPECT_LT((v1 - Vector3(9, -12, 0) / 5).norm(), 10 * kEps);
  EXPECT_LT((v2 - Vector3(16, 12, 0) / 5).norm(), 10 * kEps);
  EXPECT_NEAR(passed.impulse, 4, 10 * kEps);
  EXPECT_NEAR(passed.approach_speed, 4, 10 * kEps);
  EXPECT_EQ(v1.z(), 0);
  EXPECT_EQ(v2.z(), 0);
}

TEST(CollisionLaw, equalBallsSwapExactlyHeadOn) {
  Vector3 v1(0.1, 0, 0);
  Vector3 v2(-0.3, 0, 0);
  collide<double>(v1, 7.0, v2, 7.0, Vector3::UnitX(), 1.0);
  EXPECT_NEAR(v1.x(), -0.3, kEps);
  EXPECT_NEAR(v2.x(), 0.1, kEps);
}

TEST(CollisionLaw, actsOnlyOnApproach) {
  Vector3 v1(-1, 0.25, 0);
  Vector3 v2(1, 0, 0);
  const auto passed = collide<double>(v1, 1.0, v2, 1.0, Vector3::UnitX(), 1.0);
  EXPECT_EQ(v1, Vector3(-1, 0.25, 0));
  EXPECT_EQ(v2, Vector3(1, 0, 0));
  EXPECT_EQ(passed.impulse, 0);
  Vector3 v(0, 0, 2);
  collideWithWall<double>(v, Vector3::UnitZ(), 1.0);
  EXPECT_EQ(v, Vector3(0, 0, 2));
}

TEST(CollisionLaw, keepsMomentumAndEnergyAndRestitution) {
  RandomNumbers random(1);
  for (int i = 0; i < 2000; ++i) {
    const double m1 = std::pow(10, random.uniform(-6, 6));
    const double m2 = std::pow(10, random.uniform(-6, 6));
    const double e = i % 2 == 0 ? 1.0 : random.uniform(0, 1);
    const Vector3 n = random.direction();
    Vector3 v1 = random.gaussianVector(1);
    Vector3 v2 = random.gaussianVector(1);
    const Vector3 p = m1 * v1 + m2 * v2;
    const double energy = (m1 * v1.squaredNorm() + m2 * v2.squaredNorm()) / 2;
    const double u = dot(v1, n) - dot(v2, n);
    const auto passed = collide<double>(v1, 1 / m1, v2, 1 / m2, n, e);
    if (u < 0) continue;
    // Each of a dozen operations rounds once, relative to the larger of the terms.
    const double size = (m1 + m2) * (v1.norm() + v2.norm() + u);
    EXPECT_LT((m1 * v1 + m2 * v2 - p).norm(), 20 * kEps * size) << i;
    EXPECT_NEAR(dot(v2, n) - dot(v1, n), e * u, 20 * kEps * (v1.norm() + v2.norm() + u)) << i;
    const double lost = (1 - e * e) / 2 * u * u / (1 / m1 + 1 / m2);
    EXPECT_NEAR((m1 * v1.squaredNorm() + m2 * v2.squaredNorm()) / 2, energy - lost,
                40 * kEps * (energy + size * u))
        << i;
    EXPECT_NEAR(passed.impulse, (1 + e) * u / (1 / m1 + 1 / m2), 10 * kEps * passed.impulse) << i;
  }
}

TEST(CollisionLaw, fixedBallIsAWall) {
  Vector3 v1(1, 2, 3);
  Vector3 fixed = Vector3::Zero();
  Vector3 v = v1;
  const Vector3 n = Vector3(2, 3, 6) / 7;
  collide<double>(v1, 0.5, fixed, 0.0, n, 0.75);
  collideWithWall<double>(v, -n, 0.75);
  EXPECT_EQ(fixed, Vector3(0, 0, 0));
  EXPECT_LT((v1 - v).norm(), 20 * kEps);  // roundings of numbers up to 10
  EXPECT_NEAR(dot(v, n), -0.75 * dot(Vector3(1, 2, 3), n), 20 * kEps);
}

TEST(CollisionLaw, isTheSameSeenFromEitherBall) {
  RandomNumbers random(2);
  for (int i = 0; i < 1000; ++i) {
    const Vector3 n = random.direction();
    Vector3 v1 = random.gaussianVector(1), v2 = random.gaussianVector(1);
    const double w1 = random.uniform(0, 3), w2 = random.uniform(0.1, 3);
    Vector3 u1 = v1, u2 = v2;
    collide<double>(v1, w1, v2, w2, n, 0.9);
    collide<double>(u2, w2, u1, w1, -n, 0.9);
    EXPECT_EQ(v1, u1);  // bit for bit: the order of ids does not matter
    EXPECT_EQ(v2, u2);
  }
}

TEST(CollisionLaw, normalExistsForCentresOfAnyDistance) {
  for (const double size : {1e-320, 1e-170, 1e-30, 1.0, 1e30, 1e200, 1e307}) {
    const Vector3 n = contactNormal<double>(size * Vector3(2, 3, 6));
    // A denormal has few digits left, down to about 1/1000 at 1e-320.
    EXPECT_LT((n - Vector3(2, 3, 6) / 7).norm(), size < 1e-300 ? 1e-3 : 4 * kEps) << size;
    EXPECT_NEAR(n.norm(), 1, 4 * kEps) << size;
  }
  const Vector3 coincident = contactNormal<double>(Vector3::Zero());
  EXPECT_EQ(coincident, contactNormal<double>(Vector3::Zero()));
  EXPECT_EQ(coincident.norm(), 1);
}

TEST(CollisionLaw, partsPartnersWhoseApproachIsOnlyRounding) {
  RandomNumbers random(3);
  for (int i = 0; i < 10000; ++i) {
    const Vector3 n = random.direction();
    Vector3 along = random.gaussianVector(1);
    along -= dot(along, n) * n;  // slides along the wall, up to rounding
    Vector3 v = along;
    collideWithWall<double>(v, n, 1.0);
    ASSERT_GE(dot(v, n), 0) << i;
    ASSERT_LT((v - along).norm(), 100 * kEps) << i;
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
