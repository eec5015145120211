// OverlapIndex against the look at all pairs, for balls of all sizes, closed and periodic.
#include "ball_sim/overlap_index.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace {

struct Sphere {
  Vector3 position;
  double radius;
};

// The first of `spheres` that overlaps, by definition.
std::optional<std::size_t> slowFind(const std::vector<Sphere>& spheres, const Sphere& sphere,
                                    double edge) {
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    Vector3 between = spheres[i].position - sphere.position;
    for (int axis = 0; edge > 0 && axis < 3; ++axis) {
      between[axis] -= edge * std::round(between[axis] / edge);
    }
    if (between.norm() < (spheres[i].radius + sphere.radius) * (1 - 1e-12)) return i;
  }
  return std::nullopt;
}

// Radii over a ratio of 10^4, evenly in their logarithm, in an order that is not by size.
TEST(OverlapIndex, AgreesWithAllPairs) {
  for (const double edge : {0.0, 1.0}) {  // open; periodic
    Surroundings surroundings;
    if (edge > 0) surroundings.box = {Vector3::Zero(), Vector3::Constant(edge)};
    surroundings.periodic = edge > 0;
    test::RandomNumbers random(42);
    OverlapIndex index(surroundings);
    std::vector<Sphere> spheres;
    int hits = 0;
    for (int trial = 0; trial < 3000; ++trial) {
      const Sphere sphere = {{random.uniform(-1, 2), random.uniform(0, 1), random.uniform(0, 1)},
                             0.3 * std::pow(10, random.uniform(-4, 0))};
      const auto expected = slowFind(spheres, sphere, edge);
      ASSERT_EQ(index.find(sphere.position, sphere.radius), expected) << "trial " << trial;
      ASSERT_EQ(index.overlapsAny(sphere.position, sphere.radius), expected.has_value());
      hits += expected.has_value() ? 1 : 0;
      if (expected && random.chance(0.9)) continue;  // a crowd would overlap everything
      index.insert(spheres.size(), sphere.position, sphere.radius);
      spheres.push_back(sphere);
    }
    EXPECT_GT(hits, 300);
    EXPECT_GT(spheres.size(), 300u);
  }
}

TEST(OverlapIndex, TouchingIsNoOverlap) {
  OverlapIndex index{Surroundings()};
  index.insert(7, {0, 0, 0}, 1);
  EXPECT_FALSE(index.find({0, 0, 3}, 2));
  EXPECT_FALSE(index.find({0, 0, 3 * (1 - 0.9e-12)}, 2));
  EXPECT_EQ(index.find({0, 0, 3 * (1 - 1.1e-12)}, 2), 7u);
}

TEST(OverlapIndex, SurvivesTheFarthestAndSmallest) {
  OverlapIndex index{Surroundings()};
  index.insert(0, {1e9, -1e9, 1e9}, 1e-30);
  index.insert(1, {-1e9, 1e9, -1e9}, 1e9);
  EXPECT_EQ(index.find({1e9, -1e9, 1e9}, 1e-30), 0u);
  EXPECT_FALSE(index.find({1e9, -1e9, 1e9 - 1e-6}, 1e-30));
  EXPECT_EQ(index.find({-1e9, 1e9, -0.5e9}, 1e-30), 1u);
}

}  // namespace
}  // namespace ball_sim::core
