// The event queue: one event a ball, in a calendar of buckets.
//
// Events of the current year wait in the bucket of their time, unsorted, until it is opened: those
// of the bucket at hand play a tournament. Events beyond the year wait in one list until it turns.
// Both insertion and removal are O(1) (Paul, "A complexity O(1) priority queue for event driven
// molecular dynamics simulations", 2007). Nothing is allocated per event: a ball's agenda is its
// entry, and carries the links.
//
// Times are seconds since the year began. When the year turns the owner moves its clocks back by
// whole years, a power of two each, so that times stay small and fine however long the run is.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <limits>
#include <vector>

#include "event_driven/agenda.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"
#include "event_driven/tournament.hpp"
#include "fetch_ahead.hpp"

namespace ball_sim::core {

/// @tparam Real    double or long double
/// @tparam Before  before(slot, slot): which of two events at one instant goes first
template <class Real, class Before>
class EventQueue {
 public:
  /// How many buckets ahead a ball is announced, each time for the next step of the fetching.
  static constexpr std::uint32_t kSoon = 3;
  static constexpr std::uint32_t kNext = 1;

  /// @param agendas  by slot; outlive the queue
  EventQueue(HugePageVector<Agenda<Real>>& agendas, Before before)
      : agendas_(agendas), at_hand_(before) {}

  /// Takes all balls out and sets the calendar.
  /// @param bucket_width  s
  /// @param buckets       a power of two
  void reset(Real bucket_width, std::uint32_t buckets) {
    width_ = bucket_width;
    per_width_ = 1 / bucket_width;
    buckets_ = buckets;
    year_ = bucket_width * Real(buckets);
    heads_.resize(buckets + kFarAhead + 1);  // one can look ahead without asking
    clear();
  }

  /// Takes all balls out, and begins the year anew.
  void clear() {
    std::fill(heads_.begin(), heads_.end(), kNoSlot);
    for (Agenda<Real>& agenda : agendas_) agenda.previous = kNotQueued;
    current_ = 0;
    at_hand_.clear();
    in_year_ = 0;
  }

  Real yearLength() const { return year_; }
  Real bucketWidth() const { return width_; }
  std::size_t bytes() const { return heads_.capacity() * sizeof(Slot) + at_hand_.bytes(); }

  /// Adds a ball that is not queued. Its due() must not change while it is, and not be before the
  /// last event taken out.
  void insert(Slot slot) {
    const std::uint32_t bucket = bucketOf(agendas_[slot].due());
    in_year_ += isInYear(bucket) ? 1 : 0;
    if (bucket <= current_) {
      takeAtHand(slot);
    } else {
      link(slot, heads_[bucket]);
    }
  }

  /// Takes a ball out, queued or not.
  void remove(Slot slot) {
    Agenda<Real>& agenda = agendas_[slot];
    if (agenda.previous == kNotQueued) return;
    if (agenda.previous == kAtHand) {
      --in_year_;
      at_hand_.erase(agenda.next);
    } else {
      const std::uint32_t bucket = bucketOf(agenda.due());
      in_year_ -= isInYear(bucket) ? 1 : 0;
      unlink(agenda, heads_[bucket]);
    }
    agenda.previous = kNotQueued;
  }

  /// Looks for the next event.
  /// @param expect  expect(slot, buckets ahead): a ball comes up kSoon, kNext
  /// @return whether there is one that is due by `limit`
  template <class Expect>
  bool isDue(Real limit, Expect expect) {
    while (at_hand_.empty()) {
      if (in_year_ == 0) return false;
      const std::uint32_t last = std::min(bucketOf(limit), buckets_ - 1);
      do {
        if (current_ >= last) return false;
        ++current_;
        if (agendas_.size() > kCachedBalls) announce(expect);
      } while (heads_[current_] == kNoSlot);
      openBucket();
    }
    first_ = at_hand_.first();
    return first_.time <= limit;
  }

  struct Due {
    Slot slot;
    Real time;  // s
  };

  /// Takes out the ball whose event isDue() has just found.
  Due pop() {
    at_hand_.erase(first_.place);
    agendas_[first_.slot].previous = kNotQueued;
    --in_year_;
    return {first_.slot, first_.time};
  }

  /// Begins a new year; this one must be empty, and the clocks of the agendas moved already.
  void turnYear() {
    assert(in_year_ == 0);
    current_ = 0;
    heads_[buckets_] = kNoSlot;
    // In the order of memory, where to follow the list would jump about; what is at random are the
    // buckets, fetched some balls ahead.
    const auto last = static_cast<Slot>(agendas_.size()) - 1;
    for (Slot slot = 0; slot < agendas_.size(); ++slot) {
      fetchAhead(&heads_[bucketOf(agendas_[std::min(slot + 16, last)].due())]);
      if (agendas_[slot].previous == kNotQueued) continue;
      agendas_[slot].previous = kNotQueued;
      insert(slot);
    }
  }

  /// The earliest time of all events, when none is in this year; infinity when there are none.
  Real earliestBeyond() const {
    assert(in_year_ == 0);
    Real earliest = std::numeric_limits<Real>::infinity();
    for (const Agenda<Real>& agenda : agendas_) {
      if (agenda.previous != kNotQueued) earliest = std::min(earliest, agenda.due());
    }
    return earliest;
  }

 private:
  static constexpr std::uint32_t kFarAhead = 7;
  // Up to so many balls all is in the cache anyway, and to fetch ahead would only cost.
  static constexpr std::size_t kCachedBalls = 20000;

  // All that is beyond the year shares the bucket behind it.
  std::uint32_t bucketOf(Real due) const {
    const Real last = Real(buckets_ - 1);  // 1/width is rounded
    const Real bucket = std::max(Real(0), std::min(due * per_width_, last));
    // Without a branch, which would often be foretold wrongly.
    return static_cast<std::uint32_t>(bucket) + (due < year_ ? 0 : 1);
  }
  bool isInYear(std::uint32_t bucket) const { return bucket < buckets_; }

  // --- the bucket at hand

  // Not inlined: insert(), which seldom comes here, would save registers for it every time.
  [[gnu::noinline]] void takeAtHand(Slot slot) {
    Agenda<Real>& agenda = agendas_[slot];
    agenda.previous = kAtHand;
    agenda.next = at_hand_.insert(slot, agenda.due());
  }

  void openBucket() {
    at_hand_.startAnew();
    for (Slot slot = heads_[current_], next; slot != kNoSlot; slot = next) {
      next = agendas_[slot].next;
      takeAtHand(slot);
    }
    heads_[current_] = kNoSlot;
  }

  // Fetches the events of buckets further ahead, one more of each at every step: which is the next
  // of a list is known only when the one before has come.
  void followLists() const {
    for (std::uint32_t links = 0; links < kFarAhead - kSoon; ++links) {
      Slot slot = heads_[current_ + kFarAhead - links];
      for (std::uint32_t i = 0; i < links && slot != kNoSlot; ++i) slot = agendas_[slot].next;
      if (slot != kNoSlot) fetchAhead(&agendas_[slot]);
    }
  }

  template <class Expect>
  void announce(Expect expect) {
    followLists();
    for (const std::uint32_t ahead : {kSoon, kNext}) {
      if (current_ + ahead == buckets_) continue;  // beyond the year there is no telling when
      for (Slot s = heads_[current_ + ahead]; s != kNoSlot; s = agendas_[s].next) expect(s, ahead);
    }
  }

  void link(Slot slot, Slot& head) {
    Agenda<Real>& agenda = agendas_[slot];
    agenda.previous = kFirst;
    agenda.next = head;
    if (head != kNoSlot) agendas_[head].previous = slot;
    head = slot;
  }

  void unlink(const Agenda<Real>& agenda, Slot& head) {
    if (agenda.next != kNoSlot) agendas_[agenda.next].previous = agenda.previous;
    (agenda.previous != kFirst ? agendas_[agenda.previous].next : head) = agenda.next;
  }

  HugePageVector<Agenda<Real>>& agendas_;
  Real width_ = 1;
  Real per_width_ = 1;
  Real year_ = 0;
  HugePageVector<Slot> heads_;  // of the buckets' lists; behind them, of that beyond the year
  std::uint32_t buckets_ = 0;
  std::uint32_t current_ = 0;
  std::size_t in_year_ = 0;  // events queued that are not beyond the year
  Tournament<Real, Before> at_hand_;
  typename Tournament<Real, Before>::Winner first_{};  // of at_hand_
};

}  // namespace ball_sim::core
