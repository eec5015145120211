// Who may meet whom within a frame: a cheap test in single precision of one ball's bounding sphere
// against many others', side by side. It may say yes where it is no, never no where it is yes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "event_driven/huge_page_vector.hpp"

namespace ball_sim::core {

/// A sphere around all places that a ball takes in the rest of a frame, in a unit of the caller's.
struct SweptSphere {
  float x, y, z;
  float r;  ///< with all that the numbers may be off by
};

/// Reads a byte, so that it is in the cache when it is needed. Many reads of the like run at once;
/// a prefetch would be dropped where the page's address is not in the cache either.
inline void touch(const void* address) { (void)*static_cast<const volatile char*>(address); }

/// Spheres side by side, one lane a ball.
struct SweptLanes {
  static constexpr std::size_t kWidth = 16;  ///< so many at most are read at once

  HugePageVector<float> x, y, z, r;

  void resize(std::size_t count) {
    for (HugePageVector<float>* lane : {&x, &y, &z, &r}) {
      lane->resize(count + kWidth);  // the last lanes are read in whole widths too
    }
  }

  SweptSphere at(std::size_t i) const { return {x[i], y[i], z[i], r[i]}; }
  void set(std::size_t i, const SweptSphere& sphere) {
    x[i] = sphere.x;
    y[i] = sphere.y;
    z[i] = sphere.z;
    r[i] = sphere.r;
  }

  std::size_t bytes() const { return 4 * x.capacity() * sizeof(float); }
};

/// Neighbouring lanes, and how far the image of them that is meant lies from them.
struct LaneRun {
  std::uint32_t begin, end;
  float sx, sy, sz;
};

/// Lanes that overlap a sphere, one of several.
struct LaneHits {
  std::vector<std::uint32_t> lanes;    ///< this and the next have room for more
  std::vector<std::uint32_t> sources;  ///< numbers of the runs, or of the spheres
  std::size_t count = 0;

  void makeRoom(std::size_t size) {
    if (lanes.size() >= size) return;
    lanes.resize(2 * size);
    sources.resize(2 * size);
  }
};

/// The lanes of some runs, copied side by side, each in the image that is meant.
struct LaneBlock {
  SweptLanes lanes;
  HugePageVector<std::uint32_t> origins;  ///< which lanes they are copies of
  std::size_t count = 0;
};

/// Finds the lanes that overlap a sphere.
/// @param hits  has room for all lanes of all runs, and kWidth more; is set, with numbers of runs
void findInRuns(const SweptLanes& lanes, const SweptSphere& sphere, const LaneRun* runs,
                std::size_t count, LaneHits& hits);

/// Copies runs into a block.
void gatherRuns(const SweptLanes& lanes, const LaneRun* runs, std::size_t count, LaneBlock& block);

/// Finds what some spheres overlap in a block.
/// @param begin, step  sphere k is looked for from lane `begin + k * step` on
/// @param hits         is set, sphere after sphere, with their numbers
void findInBlock(const LaneBlock& block, const SweptSphere* spheres, std::size_t count,
                 std::size_t begin, std::size_t step, LaneHits& hits);

}  // namespace ball_sim::core
