// One ball and many others: which of them will it meet, and when?
//
// The others are read where they lie and examined several to an instruction. The arithmetic is that
// of timeOfImpact(), operation by operation, and so are the bits, whatever instruction set runs it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "ball_sim/time_of_impact.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// Index of a ball in a method's arrays.
using Slot = std::uint32_t;
constexpr Slot kNoSlot = ~Slot{0};

/// What others look at in a ball, in one cache line of doubles: the flight it is on.
template <class Real>
struct alignas(64) Body {
  VectorOf<Real> x;  ///< centre at `time`, m
  VectorOf<Real> v;  ///< velocity at `time`, m/s
  Real time;         ///< of its last change, s in this year
  Real radius;       ///< m
};

/// One ball, as it is now, in search of its next impact.
template <class Real>
struct Seeker {
  VectorOf<Real> x;  ///< m, at `now`
  VectorOf<Real> v;  ///< m/s, at `now`
  Real radius;       ///< m
  Real now;          ///< s
};

/// The nearest whole number, ties to even, of one below 2^50 in size: adding and taking away a
/// number whose last digit is 1 rounds so, in any instruction set.
template <class Real>
constexpr Real kWholeShift = Real(1.5) / std::numeric_limits<Real>::epsilon();

template <class Real>
Real nearestWhole(Real x) {
  return (x + kWholeShift<Real>)-kWholeShift<Real>;
}

/// What holds for all balls alike.
template <class Real>
struct PairSpace {
  VectorOf<Real> period = VectorOf<Real>::Zero();      ///< m; 0: that axis does not wrap
  VectorOf<Real> per_period = VectorOf<Real>::Zero();  ///< 1/m; 0 likewise
  VectorOf<Real> fall = VectorOf<Real>::Zero();        ///< acceleration of seeker and others, m/s^2
};

/// The earliest impact of a list.
template <class Real>
struct PairHit {
  Real wait = kNever<Real>;  ///< s from now, >= 0; kNever: none meets the seeker
  std::uint32_t index = 0;   ///< of the other, in the list that was searched
  bool tied = false;         ///< another of the list has the same wait
};

/// Lists are read in steps of so many: what follows the last entry, up to a whole step, is loaded
/// too, though not looked at, and must be slots that there are.
constexpr std::size_t kSearchStep = 8;

/// Finds the seeker's earliest impact with others that fly as it does.
/// @param bodies  all of them, by slot
/// @param slots   the others, `count` of them (and see kSearchStep); the seeker may be among them:
///                it never approaches itself
template <class Real>
using PairSearch = PairHit<Real> (*)(const Body<Real>* bodies, const Slot* slots, std::size_t count,
                                     const Seeker<Real>& seeker, const PairSpace<Real>& space);

/// Wider than this is slower where lists are as short as a layer of cells: the lanes stay empty,
/// and wide roots and quotients take longer.
constexpr std::size_t kLanesForFew = 4;

/// The search in the widest instructions that this processor has, of at most so many lanes.
/// @param wraps  take the nearest image on the axes that have a period
/// @param falls  the balls fall by space.fall; without it no fall is computed
template <class Real>
PairSearch<Real> choosePairSearch(bool wraps, bool falls, std::size_t most_lanes);

/// The same search in every kind of instructions that this processor has, the widest first.
template <class Real>
std::vector<PairSearch<Real>> pairSearches(bool wraps, bool falls,
                                           std::size_t most_lanes = kSearchStep);

}  // namespace ball_sim::core
