// The impacts that paths lead to within a frame.
//
// A search goes in three passes over a batch of balls, so that what one pass needs of memory is on
// its way since the one before: the grid tells where others are that may be met, then who they are
// is read, then the times of impact are computed.
//
// The time of an impact is computed from what the two balls have stored alone, at the later of
// their two times: it is the same bits whenever it is asked.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "ball_sim/time_of_impact.hpp"
#include "continuous/balls.hpp"
#include "continuous/buffer.hpp"
#include "continuous/frame.hpp"
#include "continuous/impacts.hpp"
#include "continuous/swept_grid.hpp"
#include "continuous/worker_pool.hpp"

namespace ball_sim::core::continuous {

/// Two balls that may meet.
struct Pair {
  Slot slot;
  std::uint32_t other;  ///< its position in the grid, from identify() on its slot
  Turns turns;          ///< of the image that was found; 0 where only one is near
};

/// A ball's path in the grid to the end of the frame.
struct Rest {
  Slot slot;
  SweptBall path;
};

/// What one thread needs to search.
template <class Real>
struct alignas(64) Searcher {
  SweptSearch search;
  Buffer<Pair> pairs;          ///< found, and not looked at yet
  Buffer<Impact<Real>> found;  ///< to be collected
};

constexpr std::size_t kBatch = 64;  ///< searches whose memory is asked for at once

/// Calls f(first, last) for batches of begin..end-1.
template <class Function>
void inBatches(std::size_t begin, std::size_t end, const Function& f) {
  for (; begin < end; begin += kBatch) f(begin, std::min(begin + kBatch, end));
}

template <class Real, bool kGravity>
class ImpactSearch {
  using Vec = VectorOf<Real>;

 public:
  /// @param balls, frame  outlive the search
  ImpactSearch(const Balls<Real, kGravity>& balls, const Frame<Real, kGravity>& frame,
               unsigned threads)
      : balls_(balls), frame_(frame), searchers_(threads) {}

  /// All impacts in a frame that has just begun, each pair's from one of its ends, in the order of
  /// the grid.
  /// @param impacts  takes them; empty
  void findAll(WorkerPool& pool, Buffer<Impact<Real>>& impacts) {
    searchers_.front().found.swap(impacts);  // written where they are kept, but for other threads'
    share(pool, balls_.size(), [this](std::size_t begin, std::size_t end, unsigned thread) {
      Searcher<Real>& searcher = searchers_[thread];
      searcher.search.ahead_of = SweptSearch::kNoCell;  // of another frame
      inBatches(begin, end, [&](std::size_t first, std::size_t last) {
        lookAhead(first, last, searcher);
        identify(searcher, [](Slot) {});
        considerPairs(searcher);
      });
    });
    searchers_.front().found.swap(impacts);
    collect(impacts);
  }

  Searcher<Real>& searcher(unsigned thread) { return searchers_[thread]; }

  /// Appends what the searchers have found.
  void collect(Buffer<Impact<Real>>& impacts) {
    for (Searcher<Real>& searcher : searchers_) {
      impacts.append(searcher.found);
      searcher.found.clear();
    }
  }

  // --- the passes of a search

  /// Finds where others are that a ball may meet on a path.
  void lookAround(const Rest& rest, Searcher<Real>& searcher) const {
    for (std::size_t level = 0; level < frame_.grid().levels(); ++level) {
      lookInLevel(level, rest, searcher);
    }
  }

  /// The same for two balls that have just met: they mostly look into the same cells. Each other
  /// they find once, from the smaller slot; on straight paths to a near image they do not meet
  /// again.
  void lookAround(Rest a, Rest b, Searcher<Real>& searcher) const {
    if (b.slot < a.slot) std::swap(a, b);
    const SweptGrid& grid = frame_.grid();
    const bool never_again = !kGravity && frame_.oneImageIsNear();
    const std::uint32_t lane_a = grid.positions()[a.slot];
    const std::uint32_t seen = never_again ? grid.positions()[b.slot] : kNoLane;
    for (std::size_t level = 0; level < grid.levels(); ++level) {
      if (grid.gatherAround(level, a.path, b.path, searcher.search)) {
        grid.findGathered(a.path, searcher.search);
        noteHits(a.slot, searcher, seen);
        grid.findGathered(b.path, searcher.search);
        noteHits(b.slot, searcher, lane_a);
      } else {
        lookInLevel(level, a, searcher, seen);
        lookInLevel(level, b, searcher, lane_a);
      }
    }
  }

  /// Learns who they are, and asks memory for what they are.
  /// @param fetch  is called with the slot of each, to ask for more
  template <class Fetch>
  void identify(Searcher<Real>& searcher, const Fetch& fetch) const {
    const SweptGrid& grid = frame_.grid();
    for (Pair& pair : searcher.pairs) {
      pair.other = grid.slotAt(pair.other);
      touch(&balls_.bodies[pair.other]);
      fetch(pair.other);
    }
  }

  /// Finds the impacts of pairs as they are now.
  void considerPairs(Searcher<Real>& searcher) const {
    for (const Pair& pair : searcher.pairs) {
      const Impact<Real> impact =
          meeting(balls_.pathOf(pair.slot), balls_.pathOf(pair.other), pair.turns);
      if (impact.time <= frame_.end()) searcher.found.push_back(impact);
    }
    searcher.pairs.clear();
  }

  /// Finds the impact of a ball with a wall, as it is now.
  void considerWall(Slot slot, Searcher<Real>& searcher) const {
    if (balls_.walls.empty()) return;
    const Impact<Real> impact = wallImpact(balls_.pathOf(slot), balls_.wall_visits[slot]);
    if (impact.time <= frame_.end()) searcher.found.push_back(impact);
  }

  // --- impacts of paths, if neither changes before

  /// The impact of two balls. Only `time` is valid where it lies after the end of the frame.
  /// @param turns  periods from where the grid has b to the image that was found
  Impact<Real> meeting(const Path<Real>& a, const Path<Real>& b, const Turns& turns) const {
    Impact<Real> impact;
    impact.a = a.slot;
    impact.b = b.slot;
    impact.image = {0, 0, 0};
    const Real start = std::max(a.body->time, b.body->time);
    Vec dx = balls_.positionAt(b, start) - balls_.positionAt(a, start);
    Vec dv = b.body->v - a.body->v;
    Vec da = Vec::Zero();
    if constexpr (kGravity) {
      dv = balls_.velocityAt(b, start) - balls_.velocityAt(a, start);
      da = balls_.accelerations[b.slot] - balls_.accelerations[a.slot];
    }
    if (balls_.box.repeats()) {
      const Real later = std::max(frame_.start() - start, Real(0));
      impact.image = frame_.oneImageIsNear()
                         ? balls_.box.turnsToNearest(dx + later * dv + (later * later / 2) * da)
                         : frame_.turnsBetween(a, b, turns);
      dx += balls_.box.shiftOf(impact.image);
    }
    const Real reach = a.body->radius + b.body->radius;
    if (kGravity && dot(da, da) > 0) {
      impact.time = start + timeOfImpactAccelerated<Real>(dx, dv, da, reach);
    } else {
      const Real wait = timeOfImpact<Real>(dx, dv, reach);
      const bool again = wait < kNever<Real> && haveJustMet(a, b, dx, reach);
      impact.time = again ? kNever<Real> : start + wait;
    }
    if (impact.time <= frame_.end()) {
      impact.version_a = a.card->version;
      impact.version_b = b.card->version;
    }
    return impact;
  }

  /// The impact of a ball with the wall that it visits next; kNever if not in this frame.
  Impact<Real> wallImpact(const Path<Real>& path, const WallVisit<Real>& visit) const {
    Impact<Real> impact;
    impact.time = kNever<Real>;
    if (!(visit.time <= frame_.end())) return impact;
    impact.time = visit.time;
    impact.a = path.slot;
    impact.b = kWall + visit.wall;
    impact.version_a = impact.version_b = path.card->version;
    impact.image = {0, 0, 0};
    return impact;
  }

  void giveBackRoom() {
    for (Searcher<Real>& searcher : searchers_) {
      searcher.pairs.giveBackRoom();
      searcher.found.giveBackRoom();
    }
  }

  std::size_t bytes() const {
    std::size_t bytes = 0;
    for (const Searcher<Real>& searcher : searchers_) {
      bytes += capacityBytes(searcher.pairs) + capacityBytes(searcher.found);
    }
    return bytes;
  }

 private:
  // The first pass when all are on their first paths: of a pair one looks.
  void lookAhead(std::size_t first, std::size_t last, Searcher<Real>& searcher) const {
    const SweptGrid& grid = frame_.grid();
    for (std::size_t p = first; p < last; ++p) considerWall(grid.slotAt(p), searcher);
    for (std::size_t p = first; p < last;) {
      const std::size_t end = grid.findAhead(p, last, searcher.search);
      noteAhead(p, searcher);
      p = end;
    }
    if (grid.levels() == 1) return;
    for (std::size_t p = first; p < last; ++p) lookInLevels(p, searcher);
  }

  // Looks for those of other levels.
  void lookInLevels(std::size_t p, Searcher<Real>& searcher) const {
    const SweptGrid& grid = frame_.grid();
    const Slot slot = grid.slotAt(p);
    const std::size_t level = grid.levelAt(p);
    for (std::size_t other = 0; other < grid.levels(); ++other) {
      if (!grid.seeks(level, other)) continue;
      lookInLevel(other, {slot, frame_.inGrid(balls_.pathOf(slot))}, searcher);
    }
  }

  void lookInLevel(std::size_t level, const Rest& rest, Searcher<Real>& searcher,
                   std::uint32_t seen = kNoLane) const {
    frame_.grid().findAround(level, rest.path, searcher.search);
    noteHits(rest.slot, searcher, seen);
  }

  // Notes where the balls from `first` on have found others, and asks memory who they are.
  void noteAhead(std::size_t first, Searcher<Real>& searcher) const {
    const SweptGrid& grid = frame_.grid();
    const SweptSearch& search = searcher.search;
    const bool one_image_is_near = frame_.oneImageIsNear();
    std::size_t end = makeRoom(searcher);
    for (std::size_t i = 0; i < search.hits.count; ++i) {
      const std::size_t position = first + search.hits.sources[i];
      const std::uint32_t lane = search.ahead.origins[search.hits.lanes[i]];
      Pair& pair = searcher.pairs[end];
      pair = {grid.slotAt(position), lane, {0, 0, 0}};
      if (!one_image_is_near) pair.turns = grid.imageOf(search.runOf(search.hits.lanes[i]));
      grid.fetchSlot(lane);
      end += lane != position ? 1 : 0;
    }
    searcher.pairs.resize(end);
  }

  // The same where a search has found others. @param seen  a lane that is not to be noted
  void noteHits(Slot slot, Searcher<Real>& searcher, std::uint32_t seen = kNoLane) const {
    const SweptGrid& grid = frame_.grid();
    const SweptSearch& search = searcher.search;
    const bool one_image_is_near = frame_.oneImageIsNear();
    const std::uint32_t own = grid.positions()[slot];
    std::size_t end = makeRoom(searcher);
    for (std::size_t i = 0; i < search.hits.count; ++i) {
      const std::uint32_t lane = search.hits.lanes[i];
      Pair& pair = searcher.pairs[end];
      pair = {slot, lane, {0, 0, 0}};
      if (!one_image_is_near) pair.turns = grid.imageOf(search.runs[search.hits.sources[i]]);
      grid.fetchSlot(lane);
      end += (lane != own) & (lane != seen) ? 1 : 0;
    }
    searcher.pairs.resize(end);
  }

  // For all hits. @return where the first goes
  static std::size_t makeRoom(Searcher<Real>& searcher) {
    const std::size_t before = searcher.pairs.size();
    searcher.pairs.resize(before + searcher.search.hits.count);
    return before;
  }

  // In straight relative motion two balls that have just met do not meet again. In a periodic box
  // another image of the partner may be in reach too, but not in the same direction.
  bool haveJustMet(const Path<Real>& a, const Path<Real>& b, const Vec& dx, Real reach) const {
    const BallId id_a = a.card->id, id_b = b.card->id;
    if (a.card->met != id_b || b.card->met != id_a) return false;
    const Real along = dot(dx, a.card->met_normal);
    return dot(dx, dx) < reach * reach * Real(1 + 1e-6) &&
           (id_a < id_b ? along : -along) > Real(0.9) * reach;
  }

  static constexpr std::uint32_t kNoLane = ~std::uint32_t{0};

  const Balls<Real, kGravity>& balls_;
  const Frame<Real, kGravity>& frame_;
  std::vector<Searcher<Real>> searchers_;  // one a thread
};

}  // namespace ball_sim::core::continuous
