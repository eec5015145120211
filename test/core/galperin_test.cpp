// Galperin's billiard: the number of impacts spells pi, and the whole motion is a straight line
// folded into a wedge.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/closed_form.hpp"
#include "support/methods_under_test.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr double kRadius = 0.125;
constexpr double kLight = 1;  // m, diameters cut out
constexpr double kHeavy = 2;

TestScene piBilliard(int k) {
  TestScene scene;
  scene.surroundings.box.min.x() = 0;
  scene.balls = {
      {Vector3(kLight + kRadius, 0, 0), Vector3::Zero(), kRadius, 1},
      {Vector3(kHeavy + 3 * kRadius, 0, 0), Vector3(-1, 0, 0), kRadius, std::pow(100.0, k)}};
  return scene;
}

class Galperin : public testing::TestWithParam<std::tuple<std::string, int>> {};

TEST_P(Galperin, countsTheDigitsOfPiAndEndsAsKnown) {
  const auto& [method, k] = GetParam();
  const long counts[] = {3, 31, 314, 3141, 31415, 314159};
  const GalperinBilliard truth(k, kLight, kHeavy);
  ASSERT_EQ(truth.count(), counts[k]);
  Trial run(method, piBilliard(k));
  run.advanceTo(1e4);  // the last impact of k = 0 comes at about 2 s, the balls part for ever
  EXPECT_EQ(run.collisions().size(), static_cast<std::size_t>(counts[k]));
  const Statistics statistics = run.method().statistics();
  EXPECT_EQ(statistics.ball_collisions + statistics.wall_collisions,
            static_cast<std::uint64_t>(counts[k]));
  // Rounding adds up over the impacts; the light ball's speed is up to 10^k, and so is its error.
  const double tolerance = 1e-15 * static_cast<double>(counts[k]) * 10;
  EXPECT_NEAR(run.velocity(1).x(), static_cast<double>(truth.heavySpeed()), tolerance);
  EXPECT_NEAR(run.velocity(0).x(), static_cast<double>(truth.lightSpeed()),
              tolerance * std::pow(10, k));
}

TEST_P(Galperin, isAStraightLineInTheWedge) {
  const auto& [method, k] = GetParam();
  const GalperinBilliard truth(k, kLight, kHeavy);
  Trial run(method, piBilliard(k));
  for (double t = 0; t < 4; t += 0.0625) {
    run.advanceTo(t);
    const auto [light, heavy] = truth.positionsAt(t);
    // As above, and the light ball's place is as uncertain as its speed times the time.
    const double tolerance = 1e-14 + 1e-14 * std::pow(100, k);
    if (tolerance > 1e-6) return;
    EXPECT_NEAR(run.position(0).x(), static_cast<double>(light) + kRadius, tolerance) << t;
    EXPECT_NEAR(run.position(1).x(), static_cast<double>(heavy) + 3 * kRadius, tolerance) << t;
  }
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, Galperin,
                         testing::Combine(testing::ValuesIn(exactMethods()),
                                          testing::Values(0, 1, 2, 3, 4, 5)),
                         [](const auto& instance) {
                           return std::get<0>(instance.param) + "_k" +
                                  std::to_string(std::get<1>(instance.param));
                         });

TEST(GalperinBilliard, hasTheKnownFinalSpeeds) {
  const GalperinBilliard one(1, kLight, kHeavy);
  EXPECT_NEAR(static_cast<double>(one.heavySpeed()), 0.998857595563118, 1e-14);
  EXPECT_NEAR(static_cast<double>(one.lightSpeed()), 0.477860208205886, 1e-13);
  const GalperinBilliard three(3, kLight, kHeavy);
  EXPECT_NEAR(static_cast<double>(three.heavySpeed()), 0.999999917460531, 1e-14);
  EXPECT_NEAR(static_cast<double>(three.lightSpeed()), 0.406299066323258, 1e-12);
}

class GalperinPrecision : public testing::TestWithParam<std::string> {};

// An error that does not fall with epsilon is not rounding.
TEST_P(GalperinPrecision, errorFallsWithEpsilon) {
  const int k = 4;
  const GalperinBilliard truth(k, kLight, kHeavy);
  const auto error = [&](Precision precision) {
    Trial run(GetParam(), piBilliard(k), precision);
    run.advanceTo(100);
    return std::abs(run.velocity(0).x() - static_cast<double>(truth.lightSpeed()));
  };
  const double in_double = error(Precision::double_precision);
  const double in_long_double = error(Precision::long_double);
  // 2^11 finer; a factor of 50 leaves room for luck, 1e-14 for the rounding of the comparison.
  EXPECT_LT(in_long_double, in_double / 50 + 1e-14);
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, GalperinPrecision, testing::ValuesIn(exactMethods()),
                         methodOf);

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
