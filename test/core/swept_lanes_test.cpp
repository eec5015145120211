// The cheap tests of bounding spheres, lane by lane, against the same in double precision one by
// one: each pair that overlaps is found, once, with where it comes from, and hardly any other.
#include "continuous/swept_lanes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace test {
namespace {

// Of a distance: what a dozen roundings in single precision may make of it, with room to spare.
// What is nearer to touching than that may go either way.
constexpr double kRounding = 1e-5;

using Hit = std::pair<std::uint32_t, std::uint32_t>;  // lane and source

SweptSphere randomSphere(RandomNumbers& random) {
  return {float(random.uniform(0, 10)), float(random.uniform(0, 10)), float(random.uniform(0, 10)),
          float(random.uniform(0.1, 2))};
}

// Above 0: they overlap; a share of their distance.
double overlap(const SweptSphere& a, const SweptSphere& b, const LaneRun& run) {
  const double x = double(a.x) - (double(b.x) + double(run.sx));
  const double y = double(a.y) - (double(b.y) + double(run.sy));
  const double z = double(a.z) - (double(b.z) + double(run.sz));
  return (double(a.r) + double(b.r)) / std::sqrt(x * x + y * y + z * z) - 1;
}

struct Scene {
  SweptLanes lanes;
  std::vector<LaneRun> runs;
};

// Runs of 1 to 40 lanes, so that some fill no vector, some one, some several; some are of images.
Scene randomScene(RandomNumbers& random) {
  constexpr std::uint32_t kCount = 300;
  Scene scene;
  scene.lanes.resize(kCount);
  for (std::size_t i = 0; i < kCount; ++i) scene.lanes.set(i, randomSphere(random));
  std::uint32_t begin = 0;
  while (true) {
    begin += static_cast<std::uint32_t>(random.index(10));
    const std::uint32_t end = begin + 1 + static_cast<std::uint32_t>(random.index(40));
    if (end > kCount) return scene;
    const float shift = random.chance(0.5) ? 0.0F : 10.0F;
    scene.runs.push_back({begin, end, shift, 0, -shift});
    begin = end;
  }
}

void expectHits(const LaneHits& hits, const std::map<Hit, double>& overlaps) {
  std::set<Hit> found;
  for (std::size_t i = 0; i < hits.count; ++i) {
    const Hit hit = {hits.lanes[i], hits.sources[i]};
    EXPECT_TRUE(found.insert(hit).second) << "twice";
    const auto known = overlaps.find(hit);
    ASSERT_NE(known, overlaps.end()) << hit.first << " of " << hit.second;
    EXPECT_GT(known->second, -kRounding);
  }
  for (const auto& [hit, by] : overlaps) {
    if (by <= kRounding) continue;
    EXPECT_EQ(found.count(hit), 1u) << hit.first << " of " << hit.second;
  }
}

TEST(SweptLanes, findsInRunsWhatOverlaps) {
  RandomNumbers random(1);
  std::size_t seen = 0;
  for (int i = 0; i < 300; ++i) {
    const Scene scene = randomScene(random);
    const SweptSphere sphere = randomSphere(random);
    std::map<Hit, double> overlaps;
    std::size_t count = 0;
    for (std::uint32_t k = 0; k < scene.runs.size(); ++k) {
      const LaneRun& run = scene.runs[k];
      for (std::uint32_t lane = run.begin; lane < run.end; ++lane) {
        overlaps[{lane, k}] = overlap(sphere, scene.lanes.at(lane), run);
      }
      count += run.end - run.begin;
    }
    LaneHits hits;
    hits.makeRoom(count + SweptLanes::kWidth);
    findInRuns(scene.lanes, sphere, scene.runs.data(), scene.runs.size(), hits);
    expectHits(hits, overlaps);
    seen += hits.count;
  }
  EXPECT_GT(seen, 1000u);
}

TEST(SweptLanes, findsInABlockWhatOverlaps) {
  RandomNumbers random(2);
  LaneBlock block;  // one for all, as searches keep it
  LaneHits hits;
  std::size_t seen = 0;
  for (int i = 0; i < 300; ++i) {
    const Scene scene = randomScene(random);
    gatherRuns(scene.lanes, scene.runs.data(), scene.runs.size(), block);
    std::vector<SweptSphere> spheres;
    for (int k = 0; k < 5; ++k) spheres.push_back(randomSphere(random));
    const auto begin = random.index(40);
    for (const std::size_t step : {0, 1}) {
      std::map<Hit, double> overlaps;
      std::uint32_t at = 0;
      for (const LaneRun& run : scene.runs) {
        for (std::uint32_t lane = run.begin; lane < run.end; ++lane, ++at) {
          ASSERT_EQ(block.origins[at], lane);
          for (std::uint32_t k = 0; k < spheres.size(); ++k) {
            if (at < begin + k * step) continue;
            overlaps[{at, k}] = overlap(spheres[k], scene.lanes.at(lane), run);
          }
        }
      }
      ASSERT_EQ(block.count, at);
      findInBlock(block, spheres.data(), spheres.size(), begin, step, hits);
      expectHits(hits, overlaps);
      seen += hits.count;
    }
  }
  EXPECT_GT(seen, 10000u);
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
