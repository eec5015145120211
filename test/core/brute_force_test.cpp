// Random scenes of every kind, judged by the replay: each impact happened where balls touch, by the
// collision law, and none was missed. This is what makes brute_force a twin to test others against;
// the fast methods face the same judge.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "support/methods_under_test.hpp"
#include "support/random_scenes.hpp"
#include "support/replay.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

// The replay can't know of balls that rest, nor of the guards against collapse and stopped clocks
// (see collapse_guard.hpp), which act where something presses balls together or takes their energy.
bool withinReplay(const SceneKind& kind) {
  const bool pressed = kind.gravity > 0 && kind.fixed > 0;
  const bool may_rest = kind.gravity > 0 && kind.restitution < 1;
  return !pressed && !may_rest && kind.restitution > 0.4;
}

std::vector<SceneKind> replayableKinds() {
  std::vector<SceneKind> kinds;
  for (const SceneKind& kind : sceneKinds()) {
    if (withinReplay(kind)) kinds.push_back(kind);
  }
  return kinds;
}

class RandomScenes : public testing::TestWithParam<std::tuple<std::string, SceneKind>> {};

TEST_P(RandomScenes, everyImpactIsRightAndNoneIsMissed) {
  const auto& [method, kind] = GetParam();
  std::size_t impacts = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const TestScene scene = randomScene(kind, seed);
    Trial run(method, scene);
    run.advanceTo(kind.simulated_time);
    const ReplayReport report = Replay(scene).judge(run.collisions(), run.states());
    impacts += run.collisions().size();

    // Rounding of places (units of m), grown by the steps between impacts; relative to the
    // smallest sum of radii, which is what `gap` and `overlap` are measured in.
    const double extent = 1 + kind.edge + kind.offset + 10 * kind.speed * kind.simulated_time;
    const double place = 1e-14 * extent * (1 + std::sqrt(double(run.collisions().size())));
    const double relative = 100 * place / (kind.largest_radius / kind.size_ratio);
    EXPECT_LT(report.gap, relative) << "seed " << seed;
    EXPECT_LT(report.overlap, relative) << "seed " << seed;
    EXPECT_LT(report.normal, relative) << "seed " << seed;
    EXPECT_LT(report.impulse, relative) << "seed " << seed;
    EXPECT_LT(report.recession, relative * kind.speed) << "seed " << seed;
    EXPECT_LT(report.position, 100 * place) << "seed " << seed;
    // Velocities: the log holds impulses in double; each impact rounds once or twice.
    EXPECT_LT(report.velocity, 1e-13 * kind.speed * double(1 + run.collisions().size()))
        << "seed " << seed;
    EXPECT_EQ(report.backstep, 0) << "seed " << seed;
  }
  EXPECT_GT(impacts, 10u) << "the scenes test nothing";
}

INSTANTIATE_TEST_SUITE_P(ExactMethods, RandomScenes,
                         testing::Combine(testing::ValuesIn(exactMethods()),
                                          testing::ValuesIn(replayableKinds())),
                         [](const auto& instance) {
                           return std::get<0>(instance.param) + "_" +
                                  std::get<1>(instance.param).name;
                         });

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
