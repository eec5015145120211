// Times of impact against closed forms and against a scan of the true distance in long double.
#include "ball_sim/time_of_impact.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace test {
namespace {

TEST(TimeOfImpact, rationalCaseInSpace) {
  const Vector3 dx = Vector3(5, -6.5, 15) - Vector3(-12, 4, -8);
  const Vector3 dv = Vector3(-1, 2, -3) - Vector3(3, -1, 2);
  EXPECT_NEAR(timeOfImpact<double>(dx, dv, 3.5), 4, 1e-14);  // a few roundings of 4
}

TEST(TimeOfImpact, neverForThoseThatPartOrMiss) {
  EXPECT_EQ(timeOfImpact<double>({3, 0, 0}, {1, 0, 0}, 1), kNever<double>);
  EXPECT_EQ(timeOfImpact<double>({3, 1.001, 0}, {-1, 0, 0}, 1), kNever<double>);
  EXPECT_EQ(timeOfImpact<double>({3, 0, 0}, {0, 0, 0}, 1), kNever<double>);
}

TEST(TimeOfImpact, overlappingMeetNowIffTheyApproach) {
  EXPECT_EQ(timeOfImpact<double>({0.5, 0, 0}, {-1, 0, 0}, 1), 0);
  EXPECT_EQ(timeOfImpact<double>({0.5, 0, 0}, {1, 0, 0}, 1), kNever<double>);
  EXPECT_EQ(timeOfImpact<double>({1, 0, 0}, {-1, 0, 0}, 1), 0);
}

// Pass at height h above the centre with reach R: contact after x - sqrt(R^2 - h^2) at speed 1.
// Grazes are exact down to the rounding of the inputs: with h = R (1 - d) the half chord is
// R sqrt(2 d - d^2), whose relative error is that of h over d.
TEST(TimeOfImpact, grazesAreSeenAndTimed) {
  for (const double depth : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) {
    const double height = 1 - depth;
    const long double exact_depth = 1 - static_cast<long double>(height);
    const long double half_chord = std::sqrt(exact_depth * (2 - exact_depth));
    for (const double distance : {2.0, 1000.0}) {
      const double t = timeOfImpact<double>({distance, height, 0}, {-1, 0, 0}, 1);
      // |dx x dv|^2 and R^2 v^2 are rounded to 2e-16: that over 2 sqrt(depth), and t's own ulp.
      const double tolerance = 4e-16 / std::sqrt(depth) + 4e-16 * distance;
      EXPECT_NEAR(t, static_cast<double>(distance - half_chord), tolerance)
          << depth << " from " << distance;
    }
    EXPECT_EQ(timeOfImpact<double>({1000, 1 + depth, 0}, {-1, 0, 0}, 1), kNever<double>);
  }
}

TEST(TimeOfImpact, grazeAtThousandRadii) {  // r = 1000 R away, passing 1e-8 inside and outside
  EXPECT_LT(timeOfImpact<double>({1000, 1 - 1e-8, 0}, {-1, 0, 0}, 1), 1000);
  EXPECT_EQ(timeOfImpact<double>({1000, 1 + 1e-8, 0}, {-1, 0, 0}, 1), kNever<double>);
  EXPECT_LT(timeOfImpact<double>({600, 800 - 1e-8, 0.0}, {-1, 0, 0}, 800), 600);
}

TEST(TimeOfImpact, anyScale) {
  for (const double length : {1e-30, 1e-9, 1.0, 1e9}) {
    for (const double speed : {1e-30, 1e-9, 1.0, 1e9}) {
      const double t =
          timeOfImpact<double>(length * Vector3(3, 0, 0), speed * Vector3(-1, 0, 0), length);
      EXPECT_NEAR(t / (2 * length / speed), 1, 1e-15) << length << " " << speed;
    }
  }
}

TEST(TimeToWall, withoutForce) {
  EXPECT_EQ(timeToWall<double>(3, -2, 0), 1.5);
  EXPECT_EQ(timeToWall<double>(3, 2, 0), kNever<double>);
  EXPECT_EQ(timeToWall<double>(3, 0, 0), kNever<double>);
  EXPECT_EQ(timeToWall<double>(-1e-16, -1, 0), 0);
  EXPECT_EQ(timeToWall<double>(-1e-16, 1, 0), kNever<double>);
}

TEST(TimeToWall, underGravity) {
  EXPECT_NEAR(timeToWall<double>(5, 0, -10), 1, 1e-15);
  EXPECT_NEAR(timeToWall<double>(5, 5, -10), (1 + std::sqrt(5)) / 2, 1e-15);
  EXPECT_NEAR(timeToWall<double>(5, -5, -10), (std::sqrt(5) - 1) / 2, 1e-15);
  EXPECT_NEAR(timeToWall<double>(0, 5, -10), 1, 1e-15) << "there and back";
  EXPECT_EQ(timeToWall<double>(0, 0, -10), 0) << "lies on it";
}

TEST(TimeToWall, againstForce) {
  EXPECT_EQ(timeToWall<double>(5, -5, 10), kNever<double>) << "turns 3.75 m above";
  EXPECT_EQ(timeToWall<double>(5, 0, 10), kNever<double>);
  EXPECT_NEAR(timeToWall<double>(5, -20, 10), 2 - std::sqrt(3), 1e-15);
}

/// The first contact by brute search: small steps, then bisection, in long double.
double scannedImpact(const Vector3& dx, const Vector3& dv, const Vector3& da, double reach,
                     double until) {
  const auto excess = [&](long double t) {
    const VectorOf<long double> d =
        dx.cast<long double>() + t * dv.cast<long double>() + t * t / 2 * da.cast<long double>();
    return dot(d, d) - static_cast<long double>(reach) * reach;
  };
  constexpr int kSteps = 4000;
  for (int i = 0; i < kSteps; ++i) {
    long double low = static_cast<long double>(until) * i / kSteps;
    long double high = static_cast<long double>(until) * (i + 1) / kSteps;
    if (excess(high) > 0) continue;
    for (int k = 0; k < 70; ++k) {
      const long double middle = (low + high) / 2;
      (excess(middle) > 0 ? low : high) = middle;
    }
    return static_cast<double>(high);
  }
  return kNever<double>;
}

TEST(TimeOfImpactAccelerated, agreesWithAScan) {
  RandomNumbers random(7);
  int hits = 0;
  for (int i = 0; i < 1500; ++i) {
    const Vector3 dx = random.uniform(1.05, 3) * random.direction();
    const Vector3 dv = random.gaussianVector(i % 4 == 0 ? 0 : 2);  // also from rest
    const Vector3 da = random.uniform(0.5, 10) * random.direction();
    const double reach = 1;
    const double t = timeOfImpactAccelerated<double>(dx, dv, da, reach);
    const double scanned = scannedImpact(dx, dv, da, reach, 8);
    if (scanned == kNever<double>) {
      if (t >= 8) continue;  // too late for the scan
      // Else a graze so short that the scan stepped over it: in contact all the same.
      const Vector3 d = dx + t * (dv + t / 2 * da);
      EXPECT_NEAR(d.norm(), reach, 1e-10) << i;
      continue;
    }
    ++hits;
    const Vector3 d = dx + scanned * (dv + scanned / 2 * da);
    const Vector3 v = dv + scanned * da;
    const double slope = std::abs(dot(d, v)) / reach;
    // The distance is known to about 1e-15 |dx| + ..., the date to that over the closing speed.
    if (slope > 1e-3) {
      EXPECT_NEAR(t, scanned, 1e-13 * (1 + scanned * scanned * 10) / slope) << i;
    }
  }
  EXPECT_GT(hits, 100);
}

TEST(TimeOfImpactAccelerated, dropOnABallBelow) {
  for (const double h : {1e-6, 0.01, 0.3, 5.0, 1e3}) {  // from rest: sqrt(2 h / g)
    EXPECT_NEAR(timeOfImpactAccelerated<double>({0, 0, 1 + h}, {0, 0, 0}, {0, 0, -10}, 1) /
                    std::sqrt(2 * h / 10),
                1, 1e-15 + 1e-15 / h)
        << h;
  }
}

TEST(TimeOfImpactAccelerated, overlappingMeetNowIffTheyApproach) {
  EXPECT_EQ(timeOfImpactAccelerated<double>({0, 0, 0.9}, {0, 0, -1}, {0, 0, -10}, 1), 0);
  EXPECT_GT(timeOfImpactAccelerated<double>({0, 0, 1}, {0, 0, 1}, {0, 0, -10}, 1), 0.19);
  EXPECT_EQ(timeOfImpactAccelerated<double>({0, 0, 2}, {0, 0, 0}, {0, 0, 10}, 1), kNever<double>);
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
