// A ball is inside its cube until its way out, and then on the face that it is told to leave by.
#include "event_driven/way_out.hpp"

#include <gtest/gtest.h>

#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr int kTrials = 1000;
// Of the edge: places are of the size of a few cubes, and rounded a few times.
constexpr double kRounding = 1e-13;

/// Bricks, none of whose edges are alike, and one among them.
struct Bricks {
  explicit Bricks(RandomNumbers& random) {
    for (std::size_t k = 0; k < 3; ++k) {
      lattice.spacing[k] = random.uniform(0.5, 2);
      lattice.half[k] = lattice.spacing[k] / 2;
      lattice.first[k] = random.uniform(-1, 1);
      lattice.end[k] = {-100, 100};
      brick[k] = static_cast<std::int32_t>(random.index(7)) - 3;
    }
  }

  /// Of the middle along an axis, in halves of the edge: inside is from -1 to 1.
  double fromMiddle(const Vector3& x, std::size_t k) const {
    const double middle = lattice.first[k] + brick[k] * lattice.spacing[k];
    return (x[static_cast<int>(k)] - middle) / lattice.half[k];
  }

  Vector3 placeInside(RandomNumbers& random) const {
    Vector3 x;
    for (std::size_t k = 0; k < 3; ++k) {
      x[static_cast<int>(k)] = lattice.first[k] + brick[k] * lattice.spacing[k] +
                               lattice.half[k] * random.uniform(-1, 1);
    }
    return x;
  }

  Lattice<double> lattice;
  CellCoordinates brick;
};

/// Follows the flight x + v t + a t^2 / 2 to the way out.
void expectToLeave(const Bricks& bricks, const WayOut<double>& way, const Vector3& x,
                   const Vector3& v, const Vector3& a) {
  ASSERT_LT(way.wait, kNever<double>);
  const auto at = [&](double t) { return Vector3(x + t * v + t * t / 2 * a); };
  EXPECT_NEAR(bricks.fromMiddle(at(way.wait), way.axis), way.direction, kRounding);
  for (const double part : {0.1, 0.3, 0.5, 0.7, 0.9, 1.0}) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_LE(std::abs(bricks.fromMiddle(at(part * way.wait), k)), 1 + kRounding);
    }
  }
}

TEST(WayOut, LeavesByTheFirstFaceOnAStraightFlight) {
  RandomNumbers random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Bricks bricks(random);
    const Vector3 x = bricks.placeInside(random);
    const Vector3 v = random.gaussianVector(1);
    expectToLeave(bricks, wayOut<double>(x, v, bricks.lattice, bricks.brick), x, v,
                  Vector3::Zero());
  }
}

TEST(WayOut, LeavesByTheFirstFaceInAFall) {
  RandomNumbers random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Bricks bricks(random);
    const Vector3 x = bricks.placeInside(random);
    const Vector3 v = random.gaussianVector(1);
    const Vector3 a = random.gaussianVector(3);
    expectToLeave(bricks, wayOutFalling<double>(x, v, a, bricks.lattice, bricks.brick), x, v, a);
  }
}

TEST(WayOut, DoesNotLeaveWhereThereIsNoWay) {
  RandomNumbers random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    Bricks bricks(random);
    const Vector3 x = bricks.placeInside(random);
    const Vector3 v = random.gaussianVector(1);
    const std::size_t closed = random.index(3);
    const std::size_t side = v[static_cast<int>(closed)] < 0 ? 0 : 1;
    bricks.lattice.has_ends = true;
    bricks.lattice.end[closed][side] = bricks.brick[closed];
    EXPECT_NE(wayOut<double>(x, v, bricks.lattice, bricks.brick).axis, closed);
    EXPECT_NE(wayOutFalling<double>(x, v, Vector3::Zero(), bricks.lattice, bricks.brick).axis,
              closed);
  }
}

TEST(WayOut, StaysWhenAtRest) {
  RandomNumbers random(4);
  const Bricks bricks(random);
  const Vector3 x = bricks.placeInside(random);
  const Vector3 rest = Vector3::Zero();
  EXPECT_EQ(wayOut<double>(x, rest, bricks.lattice, bricks.brick).wait, kNever<double>);
  EXPECT_EQ(wayOutFalling<double>(x, rest, rest, bricks.lattice, bricks.brick).wait,
            kNever<double>);
}

// A ball that rounding has put behind the face it flies to leaves at once, and never in the past.
TEST(WayOut, NeverWaitsLessThanNothing) {
  RandomNumbers random(5);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Bricks bricks(random);
    Vector3 x = bricks.placeInside(random);
    const Vector3 v = random.gaussianVector(1);
    const std::size_t k = random.index(3);
    const double sign = v[static_cast<int>(k)] < 0 ? -1 : 1;
    x[static_cast<int>(k)] = bricks.lattice.first[k] + bricks.brick[k] * bricks.lattice.spacing[k] +
                             sign * bricks.lattice.half[k] * (1 + 1e-15);
    const WayOut<double> way = wayOut<double>(x, v, bricks.lattice, bricks.brick);
    EXPECT_GE(way.wait, 0);
    EXPECT_LT(way.wait, 1e-300);
    EXPECT_EQ(way.axis, k);
    EXPECT_EQ(way.direction, sign);
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
