// A tournament of balls: whose event is the earliest?
//
// The balls' times stand in groups of eight; the earliest of each group stands for it in a group of
// the level above, up to one group at the top. Of eight times the least is found without a branch,
// and in the event queue eight are mostly all there are.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

constexpr std::size_t kGroupBits = 3;
constexpr std::size_t kGroup = std::size_t{1} << kGroupBits;

/// The least of a group, and who has it.
template <class Real>
struct LeastOfGroup {
  Real time;
  unsigned holders;  ///< a bit for each that equals it, the first of the group lowest
};

template <class Real>
LeastOfGroup<Real> leastOfGroup(const Real* times) {
  Real least = times[0];
  for (std::size_t i = 1; i < kGroup; ++i) least = times[i] < least ? times[i] : least;
  unsigned holders = 0;
  for (std::size_t i = 0; i < kGroup; ++i) holders |= (times[i] == least ? 1U : 0U) << i;
  return {least, holders};
}

#if defined(__SSE2__)
inline LeastOfGroup<double> leastOfGroup(const double* times) {
  const __m128d a = _mm_load_pd(times), b = _mm_load_pd(times + 2);
  const __m128d c = _mm_load_pd(times + 4), d = _mm_load_pd(times + 6);
  __m128d least = _mm_min_pd(_mm_min_pd(a, b), _mm_min_pd(c, d));
  least = _mm_min_pd(least, _mm_shuffle_pd(least, least, 1));
  const auto holders = [&least](__m128d two) {
    return static_cast<unsigned>(_mm_movemask_pd(_mm_cmpeq_pd(two, least)));
  };
  return {_mm_cvtsd_f64(least), holders(a) | holders(b) << 2 | holders(c) << 4 | holders(d) << 6};
}
#endif

/// @tparam Real    double or long double
/// @tparam Before  before(slot, slot): which of two balls with the same time goes first
template <class Real, class Before>
class Tournament {
 public:
  explicit Tournament(Before before) : before_(before) {
    makeRoom(kGroup * kGroup);  // more than a bucket of events at different times ever holds
    clear();
  }

  bool empty() const { return count_ == 0; }

  struct Winner {
    Slot slot;
    Real time;            // s
    std::uint32_t place;  // for erase()
  };

  /// Who goes first. There must be somebody.
  Winner first() const {
    const std::uint32_t place = winnerOf(top_, 0);
    return {slots_[place], levels_[0].times[place], place};
  }

  /// @param time  s, finite
  /// @return the ball's place, until it is taken out
  std::uint32_t insert(Slot slot, Real time) {
    const std::uint32_t place = takePlace();
    slots_[place] = slot;
    levels_[0].times[place] = time;
    ++count_;
    replay(place);
    return place;
  }

  void erase(std::uint32_t place) {
    levels_[0].times[place] = kNever<Real>;
    free_places_.push_back(place);
    --count_;
    replay(place);
  }

  /// Takes all out.
  void clear() {
    for (Level& level : levels_) level.times.assign(level.times.size(), kNever<Real>);
    count_ = 0;
    startAnew();
  }

  /// Makes an empty tournament as low as can be, however high it was.
  void startAnew() {
    used_ = 0;
    free_places_.clear();
    top_ = 0;
    capacity_ = kGroup;
  }

  std::size_t bytes() const {
    std::size_t bytes = (slots_.capacity() + free_places_.capacity()) * sizeof(Slot);
    for (const Level& level : levels_) {
      bytes += level.times.capacity() * sizeof(Real) + level.winners.capacity() * sizeof(Slot);
    }
    return bytes;
  }

 private:
  // By place on the lowest level, by group of the level below on those above.
  struct Level {
    HugePageVector<Real> times;          // kNever: nobody's
    std::vector<std::uint32_t> winners;  // whose these are, by place
  };

  void makeRoom(std::size_t places) {
    if (slots_.size() >= places) return;
    slots_.resize(places);
    free_places_.reserve(places);
    for (std::size_t level = 0; places >= kGroup; ++level, places >>= kGroupBits) {
      levels_[level].times.resize(places, kNever<Real>);
      levels_[level].winners.resize(places);
    }
    std::iota(levels_[0].winners.begin(), levels_[0].winners.end(), 0U);
  }

  std::uint32_t takePlace() {
    if (!free_places_.empty()) {
      const std::uint32_t place = free_places_.back();
      free_places_.pop_back();
      return place;
    }
    if (used_ == capacity_) {
      ++top_;
      capacity_ *= kGroup;
      makeRoom(capacity_);
      replay(0);  // the group that was the top one
    }
    return used_++;
  }

  // After a change at this place, all groups above it.
  void replay(std::uint32_t place) {
    std::uint32_t group = place;
    for (std::size_t level = 0; level < top_; ++level) {
      group >>= kGroupBits;
      const std::uint32_t winner = winnerOf(level, group);
      levels_[level + 1].winners[group] = winner;
      levels_[level + 1].times[group] = levels_[0].times[winner];
    }
  }

  std::uint32_t winnerOf(std::size_t level, std::uint32_t group) const {
    const std::uint32_t* const winners = &levels_[level].winners[group * kGroup];
    const auto least = leastOfGroup(&levels_[level].times[group * kGroup]);
    unsigned holders = least.holders;
    std::uint32_t winner = winners[__builtin_ctz(holders)];
    while ((holders &= holders - 1) != 0 && least.time < kNever<Real>) {  // seldom
      const std::uint32_t other = winners[__builtin_ctz(holders)];
      if (before_(slots_[other], slots_[winner])) winner = other;
    }
    return winner;
  }

  Before before_;
  std::array<Level, 9> levels_;  // lowest first; enough for 2^27 balls
  std::size_t top_ = 0;          // the level of a single group
  std::size_t capacity_ = 0;     // places up to there
  std::vector<Slot> slots_;      // by place
  std::vector<std::uint32_t> free_places_;
  std::uint32_t used_ = 0;  // places that were ever taken
  std::size_t count_ = 0;   // balls in it
};

}  // namespace ball_sim::core
