// Time stays fine at any date.
#include "ball_sim/time.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace ball_sim::core {
namespace test {
namespace {

TEST(Time, keepsItsFractionAtAnyDate) {
  for (const double start : {0.0, 1e9, 1e15}) {
    const Time t = Time::fromSeconds(start);
    const double small = 0x1p-50 + 0x1p-20;
    EXPECT_EQ((t + small) - t, small) << start;
    EXPECT_EQ((t + 0.125) + 0.875, t + 1.0) << start;
  }
}

TEST(Time, countsBackwards) {
  const Time t = Time::fromSeconds(5);
  EXPECT_EQ((t + -0.25) - t, -0.25);
  EXPECT_EQ(t + -5.0, Time());
  EXPECT_EQ((Time() + -0.5).seconds(), -0.5);
  EXPECT_LT(Time() + -1e-12, Time());
  EXPECT_LE(Time() + -1e-300, Time());  // less than a fraction holds: no jump by a second
  EXPECT_GT((Time() + -1e-300).seconds(), -1e-15);
}

TEST(Time, ordersByWholeAndFraction) {
  const Time a = Time::fromSeconds(1e9) + 0.25;
  const Time b = Time::fromSeconds(1e9) + 0.5;
  EXPECT_TRUE(a < b && a <= b && b > a && b >= a && a != b);
  EXPECT_TRUE(Time::fromSeconds(2) > Time::fromSeconds(1) + 0.75);
  EXPECT_EQ(a, a);
}

TEST(Time, takesAndGivesNanoseconds) {
  for (const std::int64_t ns :
       {std::int64_t{0}, std::int64_t{1}, std::int64_t{-1}, std::int64_t{999999999},
        std::int64_t{1000000000}, std::int64_t{1234567890123456789}, std::int64_t{-1500000001}}) {
    EXPECT_EQ(Time::fromNanoseconds(ns).nanoseconds(), ns);
  }
  EXPECT_EQ(Time::fromSeconds(1.5).nanoseconds(), 1500000000);
  EXPECT_EQ(Time::fromSeconds(0.9999999999).nanoseconds(), 1000000000);
}

TEST(Time, sumsOfManyStepsDoNotDrift) {
  Time t = Time::fromSeconds(1e9);
  for (int i = 0; i < 1000000; ++i) t = t + 1e-3;
  // A million roundings of 1e-16 s, all the same way at worst.
  EXPECT_NEAR(t - Time::fromSeconds(1e9), 1e3, 1e-9);
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
