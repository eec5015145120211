// The stepping methods: no allocation once running, and how much memory a ball takes.
#include <gtest/gtest.h>

#include <string>

#include "support/allocation_counter.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

class SteppingMemory : public testing::TestWithParam<std::string> {};

TEST_P(SteppingMemory, NothingIsAllocatedOnceRunning) {
  for (const double gravity : {0.0, 5.0}) {
    SceneKind kind;
    kind.count = 60;
    kind.gravity = gravity;
    kind.restitution = gravity > 0 ? 0.9 : 1;
    const TestScene scene = randomScene(kind, 1);
    MethodSettings settings;
    settings.time_step = 1e-3;
    Trial run(GetParam(), scene, settings);
    run.method().setCollisionLog(nullptr);
    run.advanceTo(8);  // long enough for the lists of pairs to have been at their longest
    const long before = allocations;
    run.advanceTo(9);
    EXPECT_EQ(allocations - before, 0) << "gravity " << gravity;
  }
}

TEST_P(SteppingMemory, ABallTakesAFewHundredBytes) {
  SceneKind kind;
  kind.count = 300;
  kind.largest_radius = 0.04;
  const TestScene scene = randomScene(kind, 1);
  ASSERT_EQ(scene.balls.size(), 300u);
  Trial run(GetParam(), scene);
  run.advanceTo(1);
  const std::size_t bytes = run.method().statistics().bytes / 300;
  EXPECT_LT(bytes, 450u);  // its own 100, cells, pairs, and what vectors keep in reserve
  EXPECT_GT(bytes, 100u);
}

INSTANTIATE_TEST_SUITE_P(Methods, SteppingMemory, testing::Values("discrete", "soft_sphere"),
                         [](const auto& instance) { return std::string(instance.param); });

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
