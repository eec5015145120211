// The order of balls in memory: along a space-filling curve, so that neighbours in space are
// neighbours in memory.
//
// Space is cut into bricks of a few balls each, and balls are counted into them, which takes less
// than a byte a ball. Within a brick they keep the order they have: it lies in a few cache lines.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// A curve through bricks: a box is halved across its longest edge again and again, and the curve
/// goes through all of one half before the other. In a cube it is Morton's (1966).
template <class Real>
class SpaceCurve {
  using Vec = VectorOf<Real>;

 public:
  static constexpr unsigned kMostHalvings = 30;

  SpaceCurve() = default;

  /// @param low       lower corner of the box, m
  /// @param size      its edges, m, >= 0
  /// @param halvings  at most kMostHalvings: there are 2^halvings bricks
  SpaceCurve(const Vec& low, const Vec& size, unsigned halvings) : low_(low), halvings_(halvings) {
    Vec edge = size;
    for (unsigned i = halvings; i-- > 0;) {
      int longest = 0;
      edge.maxCoeff(&longest);
      edge[longest] /= 2;
      axis_[i] = static_cast<std::uint8_t>(longest);
    }
    std::array<std::uint8_t, 3> bits{};
    for (unsigned i = 0; i < halvings; ++i) bit_[i] = bits[axis_[i]]++;
    for (int k = 0; k < 3; ++k) per_edge_[k] = edge[k] > 0 ? 1 / edge[k] : Real(0);
  }

  std::uint32_t bricks() const { return std::uint32_t{1} << halvings_; }

  /// The brick around a place, by its number along the curve. Beyond the box bricks repeat.
  /// @param x  m
  std::uint32_t brickAt(const Vec& x) const {
    std::array<std::uint32_t, 3> in_edges{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<int>(k);
      const Real edges = (x[axis] - low_[axis]) * per_edge_[axis];
      in_edges[k] = static_cast<std::uint32_t>(static_cast<std::int64_t>(edges));
    }
    std::uint32_t brick = 0;
    for (unsigned i = 0; i < halvings_; ++i) brick |= (in_edges[axis_[i]] >> bit_[i] & 1) << i;
    return brick;
  }

 private:
  Vec low_ = Vec::Zero();
  Vec per_edge_ = Vec::Zero();  // 1/m, of a brick
  unsigned halvings_ = 0;
  std::array<std::uint8_t, kMostHalvings> axis_{};  // of each halving, the last one first
  std::array<std::uint8_t, kMostHalvings> bit_{};   // which of that axis it is, likewise
};

/// Finds the order.
class MemoryOrder {
 public:
  /// So many balls share a brick, or up to twice as many, where they are spread evenly.
  static constexpr std::size_t kBallsPerBrick = 8;

  /// Numbers balls along the curve.
  /// @param position  position(i): where ball i is, m
  /// @param is_gone   is_gone(i): there is no such ball; those come last
  /// @param numbers   in: as many as there are balls, and balls gone; out: the number of each
  template <class Position, class IsGone>
  void number(Position position, IsGone is_gone, std::vector<std::uint32_t>& numbers) {
    const auto count = static_cast<std::uint32_t>(numbers.size());
    const auto curve = curveThrough(position, count);
    begin_.assign(curve.bricks() + 1, 0);
    for (std::uint32_t i = 0; i < count; ++i) {
      numbers[i] = is_gone(i) ? curve.bricks() : curve.brickAt(position(i));
      ++begin_[numbers[i]];
    }
    std::uint32_t before = 0;
    for (std::uint32_t& begin : begin_) before += std::exchange(begin, before);
    for (std::uint32_t& number : numbers) number = begin_[number]++;
  }

  std::size_t bytes() const { return begin_.capacity() * sizeof(std::uint32_t); }

 private:
  // A box as large as if balls were spread evenly: few that have flown far from all others do not
  // make the bricks too large for these.
  template <class Position>
  static auto curveThrough(Position position, std::uint32_t count) {
    using Vec = decltype(position(0));
    using Real = typename Vec::Scalar;
    if (count == 0) return SpaceCurve<Real>();
    const Vec first = position(0);
    Vec sum = Vec::Zero();
    Vec squares = Vec::Zero();
    for (std::uint32_t i = 0; i < count; ++i) {
      const Vec x = position(i) - first;
      sum += x;
      squares += x.cwiseProduct(x);
    }
    const Vec mean = sum / Real(count);
    const Vec variance = (squares / Real(count) - mean.cwiseProduct(mean)).cwiseMax(Real(0));
    const Vec size = (Real(12) * variance).cwiseSqrt();
    unsigned halvings = 0;
    while (halvings < SpaceCurve<Real>::kMostHalvings &&
           (kBallsPerBrick << (halvings + 1)) <= count) {
      ++halvings;
    }
    return SpaceCurve<Real>(first + mean - size / 2, size, halvings);
  }

  std::vector<std::uint32_t> begin_;  // by brick: the next number there
};

}  // namespace ball_sim::core
