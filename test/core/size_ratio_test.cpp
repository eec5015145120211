// Among thousands of specks one ball a thousand or ten thousand times as wide: the multi-level grid
// lets no speck pay for it. Work is counted, not timed: events, and the balls that each of them has
// to look at. That the events are the right ones is for the tests against the slow twin.
//
// Not shown, since not so: that an impact of the large ball itself is cheap. It looks at all specks
// in the cells around it, so where many specks and several large balls are, those searches rule.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "event_driven/grid_layout.hpp"
#include "support/random_scenes.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr std::size_t kSpecks = 4000;
constexpr double kLarge = 0.2;  // m, radius, in a box of edge 1 m

/// Specks in a closed box, the first ones; then, in the middle, perhaps one large ball.
TestScene specks(double ratio, bool planar, bool with_large) {
  SceneKind kind;
  kind.planar = planar;
  RandomNumbers random(1);
  TestScene scene;
  scene.surroundings.box = {Vector3::Zero(), Vector3(1, 1, planar ? 0 : 1)};
  const Ball large{Vector3(0.5, 0.5, planar ? 0 : 0.5), Vector3::Zero(), kLarge, 1e9};
  while (scene.balls.size() < kSpecks) {
    const Ball speck{randomPlace(kind, random), randomVelocity(kind, random), kLarge / ratio, 1};
    if (isFree(scene.surroundings, {large}, speck)) scene.balls.push_back(speck);
  }
  if (with_large) scene.balls.push_back(large);
  return scene;
}

/// How many balls a search looks at: the mean over the specks, and for the last ball.
struct Near {
  double speck = 0;
  double last = 0;
};

Near countNear(const TestScene& scene) {
  std::vector<GridBall<double>> balls;
  for (const Ball& ball : scene.balls) balls.push_back({ball.position, ball.radius});
  CellGrid<double> grid = layOutGrid<double>(scene.surroundings, balls, 0);
  grid.resize(balls.size());
  const auto levelOf = [&grid](double radius) {
    std::size_t level = grid.levels().size() - 1;
    while (level > 0 && grid.edge(0, level) < 2 * radius * kCellMargin) --level;
    return level;
  };
  const auto cellOf = [&](const GridBall<double>& ball) {
    return grid.coordinatesOf(ball.x, grid.levels()[levelOf(ball.radius)].depth());
  };
  for (std::size_t i = 0; i < balls.size(); ++i) {
    grid.link(static_cast<Slot>(i), cellOf(balls[i]), levelOf(balls[i].radius));
  }
  Near near;
  Candidates candidates;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    grid.gatherNear(cellOf(balls[i]), levelOf(balls[i].radius), candidates);
    near.last = double(candidates.count);
    if (i < kSpecks) near.speck += near.last / double(kSpecks);
  }
  return near;
}

/// What a second of simulated time costs.
struct Work {
  double events = 0;  ///< a speck
  double pairs = 0;   ///< a speck: balls looked at by all searches
  std::size_t large_impacts = 0;
};

Work workOf(const TestScene& scene) {
  Trial run("event_driven", scene);
  run.advanceTo(1);
  Work work;
  for (const Collision& impact : run.collisions()) {
    work.large_impacts += impact.b == Partner{kSpecks} ? 1u : 0u;
  }
  const Near near = countNear(scene);
  work.events = double(run.method().statistics().events) / double(kSpecks);
  work.pairs = work.events * near.speck + double(work.large_impacts) / double(kSpecks) * near.last;
  return work;
}

class SizeRatio : public testing::TestWithParam<bool> {};

// The bound is the one asked for; measured are events 0.7 to 0.8 times, pairs 2.8 to 4.0 times.
TEST_P(SizeRatio, OneLargeBallCostsTheSpecksAtMostFiveTimesTheWork) {
  const bool planar = GetParam();
  for (const double ratio : {1e3, 1e4}) {
    const Work equal = workOf(specks(ratio, planar, false));
    const Work mixed = workOf(specks(ratio, planar, true));
    EXPECT_EQ(equal.large_impacts, 0u);
    EXPECT_GT(mixed.large_impacts, 200u);
    EXPECT_LT(mixed.events, 5 * equal.events) << ratio;
    EXPECT_LT(mixed.pairs, 5 * equal.pairs) << ratio;
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, SizeRatio, testing::Bool(), [](const auto& instance) {
  return std::string(instance.param ? "planar" : "spatial");
});

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
