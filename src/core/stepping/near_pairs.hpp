// Broad phase of the stepping methods: the pairs that may touch within the next steps.
//
// All pairs nearer than their reach and a skin are listed; the list is good until some ball has
// moved half a skin (Verlet, "Computer experiments on classical fluids", 1967). It is found by
// a uniform grid whose cells are as wide as the largest ball, filled by counting, O(N).
//
// Misses: in a periodic box less than two reaches wide a ball meets only the nearest image of
// another. Limits: balls of a size ratio s share a cell with up to s^3 smaller ones, so the search
// costs that much more; meant for ratios up to about 10.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/walls.hpp"
#include "stepping/stepped_ball.hpp"

namespace ball_sim::core {

/// Two balls, or a ball and a wall, that are near each other, and what a method remembers of them.
struct NearPair {
  Slot a = 0;               ///< a ball that moves
  std::uint32_t b = 0;      ///< another ball, or kFirstWall + index of a wall
  std::uint32_t image = 0;  ///< of b, as seen from a: an index into shifts()
  bool touching = false;    ///< the method's; what it remembers is kept while this is set
  double impulse = 0;       ///< N s, the method's: what passes in a step, or has passed so far
  double reference = 0;     ///< the method's: what to compare with later
};

class NearPairs {
 public:
  explicit NearPairs(const Surroundings& surroundings);

  /// Whether the list still names all pairs that may touch.
  bool isGood() const { return 2 * moved_ <= skin_; }

  /// Balls have come, gone or been moved: the list is not good any more.
  void invalidate() { skin_ = -1; }

  /// To be told after every step: how far a ball has moved at most, m.
  void noteMove(double distance) { moved_ += distance; }

  /// Lists the pairs anew; pairs that touch keep what was remembered of them.
  /// @param balls     their places are wrapped into a periodic box
  /// @param movers    slots of the balls that move, ascending
  /// @param still     slots of those that do not; two of these are no pair
  /// @param distance  how far a ball moves in a step at most, about, m
  /// @param margin    m; pairs are listed already when so near
  void list(std::vector<SteppedBall>& balls, const std::vector<Slot>& movers,
            const std::vector<Slot>& still, double distance, double margin);

  std::vector<NearPair>& pairs() { return pairs_; }
  const std::vector<NearPair>& pairs() const { return pairs_; }

  /// Calls visit(pair) for each pair, those of balls that stopped moving in touch included: these
  /// are not listed, but remembered. The contact is forgotten when it returns true.
  template <class Visit>
  void forgetContactsIf(Visit visit) {
    for (NearPair& pair : pairs_) {
      if (visit(pair)) pair.touching = false;
    }
    dormant_.erase(std::remove_if(dormant_.begin(), dormant_.end(), visit), dormant_.end());
  }

  const std::vector<Wall<double>>& walls() const { return walls_; }

  /// From ball a to the image of ball b that the pair is about, m.
  Vector3 between(const NearPair& pair, const SteppedBall& a, const SteppedBall& b) const {
    return (b.x - a.x) + shifts_[pair.image];
  }

  std::size_t bytes() const;

 private:
  struct Axis {
    double origin = 0;        // m
    double per_width = 0;     // 1/m
    std::uint32_t cells = 1;  // 1: that axis is not cut
    bool wraps = false;       // the last cell is beside the first one
  };
  struct AxisCells {
    std::array<std::uint32_t, 3> cell{};
    std::uint32_t count = 0;
  };

  void cut(const std::vector<SteppedBall>& balls, const std::vector<Slot>& movers,
           const std::vector<Slot>& still, double width);
  void fill(const std::vector<SteppedBall>& balls, const std::vector<Slot>& movers,
            const std::vector<Slot>& still);
  void findPairsOf(const std::vector<SteppedBall>& balls, Slot mover, double margin);
  void findWallsOf(const SteppedBall& ball, Slot mover, double margin);
  void keepTouching();
  void recall();
  std::uint32_t cellAlong(std::size_t axis, double x) const;
  AxisCells around(std::size_t axis, std::uint32_t cell) const;
  std::uint32_t nearestImage(const Vector3& between) const;

  Surroundings surroundings_;
  std::vector<Wall<double>> walls_;
  Vector3 period_ = Vector3::Zero();  // m; 0: that axis is not periodic
  std::array<Vector3, 27> shifts_;    // m
  std::array<Axis, 3> axes_;
  double skin_ = -1;  // m; below 0: there is no list yet
  double moved_ = 0;  // m, at most, by any ball since the list was made
  std::vector<NearPair> pairs_;
  std::vector<NearPair> touching_;  // of the list before
  std::vector<NearPair> dormant_;
  std::vector<std::uint32_t> first_;  // of each slot's pairs; one more at the end of movers
  std::vector<std::uint32_t> behind_;
  std::vector<std::uint8_t> moves_;                  // one a slot
  std::vector<std::uint32_t> cell_begin_;            // in members_
  std::vector<std::uint32_t> members_;               // slots, by cell
  std::vector<std::array<std::uint32_t, 3>> cells_;  // one a slot
};

}  // namespace ball_sim::core
