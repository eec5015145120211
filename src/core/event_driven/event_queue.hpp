// The event queue: one event a ball, in a calendar of buckets.
//
// Events of the current year wait in the bucket of their time, unsorted, until it is opened and
// sorted; those that come late into the bucket at hand wait in a heap beside it; events beyond the
// year wait in one list until it turns. Both insertion and removal are O(1) (Paul, "A complexity
// O(1) priority queue for event driven molecular dynamics simulations", 2007). Nothing is allocated
// per event: a ball's agenda is its entry, and carries the links.
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

#include "ball_sim/ball.hpp"
#include "event_driven/cell_grid.hpp"
#include "event_driven/huge_page_vector.hpp"
#include "event_driven/pair_search.hpp"

namespace ball_sim::core {

/// Instead of a previous slot in a list of the queue.
constexpr Slot kFirst = ~Slot{0};          ///< first of its list
constexpr Slot kNotQueued = ~Slot{0} - 1;  ///< in none
constexpr Slot kAtHand = ~Slot{0} - 2;     ///< in the bucket at hand

/// What only the ball itself needs, in one cache line of doubles: its next event, its cell, its
/// name and mass, and its place in the queue.
template <class Real>
struct alignas(64) Agenda {
  Real impact_time = kNever<Real>;    ///< s, in this year
  Real crossing_time = kNever<Real>;  ///< s, in this year: out of its cell or region
  double mass = 0;                    ///< kg
  std::uint32_t partner = 0;          ///< slot of whom it meets, or a wall
  std::uint32_t partner_version = 0;  ///< the partner's version when the impact was found
  std::uint32_t version = 0;          ///< counts the changes of this ball's trajectory
  BallId id = 0;
  CellCoordinates cell = {0, 0, 0};
  Slot next = kNoSlot;         ///< in the list of its bucket; at hand, the stamp of its entry
  Slot previous = kNotQueued;  ///< likewise, or one of the marks above
  std::uint8_t level = 0;      ///< index into the grid's levels
  std::uint8_t crossing_axis = 0;
  std::int8_t crossing_direction = 0;  ///< -1 or +1

  Real due() const { return std::min(impact_time, crossing_time); }
};
static_assert(sizeof(Agenda<double>) == 64);

/// @tparam Real  double or long double
template <class Real>
class EventQueue {
 public:
  /// How many buckets ahead a ball is announced, each time for the next step of the fetching.
  static constexpr std::uint32_t kSoon = 3;
  static constexpr std::uint32_t kSooner = 2;
  static constexpr std::uint32_t kNext = 1;

  /// @param agendas  by slot; outlive the queue
  explicit EventQueue(HugePageVector<Agenda<Real>>& agendas) : agendas_(agendas) {}

  /// Forgets all entries and sets the calendar.
  /// @param bucket_width  s, a power of two
  /// @param buckets       a power of two
  void reset(Real bucket_width, std::uint32_t buckets) {
    width_ = bucket_width;
    per_width_ = 1 / bucket_width;
    buckets_ = buckets;
    heads_.assign(buckets + kFarAhead + 1, kNoSlot);  // one can look ahead without asking
    for (Agenda<Real>& agenda : agendas_) agenda.previous = kNotQueued;
    beyond_ = kNoSlot;
    current_ = 0;
    clearBucket();
    in_year_ = 0;
  }

  Real yearLength() const { return width_ * Real(buckets_); }
  Real bucketWidth() const { return width_; }
  std::size_t bytes() const {
    return heads_.capacity() * sizeof(Slot) +
           (sorted_.capacity() + late_.capacity() + tied_.capacity()) * sizeof(Entry);
  }

  /// Adds a ball that is not queued. Its due() must not change while it is, and not be before the
  /// last event taken out.
  /// @param order  order(slot): of events at one instant the one with the smaller id goes first
  template <class Order>
  void insert(Slot slot, Order order) {
    const Real due = agendas_[slot].due();
    if (isBeyondYear(due)) {
      link(slot, beyond_);
      return;
    }
    ++in_year_;
    const std::uint32_t bucket = bucketOf(due);
    if (bucket <= current_) {
      late_.push_back(entryOf(slot, order));
      std::push_heap(late_.begin(), late_.end(), isLater);
    } else {
      link(slot, heads_[bucket]);
    }
  }

  /// Takes a ball out, queued or not.
  void remove(Slot slot) {
    Agenda<Real>& agenda = agendas_[slot];
    if (agenda.previous == kNotQueued) return;
    const Real due = agenda.due();
    const bool beyond = isBeyondYear(due);
    if (!beyond) --in_year_;
    if (agenda.previous != kAtHand) unlink(agenda, beyond ? beyond_ : heads_[bucketOf(due)]);
    agenda.previous = kNotQueued;  // what the open bucket holds of it is skipped later
  }

  /// Looks for the next event.
  /// @param expect  expect(slot, buckets ahead): a ball comes up kSoon, kSooner, kNext
  /// @return whether there is one that is due by `limit`
  template <class Order, class Expect>
  bool isDue(Real limit, Order order, Expect expect) {
    while (true) {
      while (position_ < sorted_.size() || !late_.empty()) {
        const Entry& first = firstAtHand();
        if (isLive(first)) return first.due <= limit;
        skip();
      }
      if (in_year_ == 0) return false;
      const std::uint32_t last = isBeyondYear(limit) ? buckets_ - 1 : bucketOf(limit);
      do {
        if (current_ >= last) return false;
        ++current_;
        if (agendas_.size() > kCachedBalls) announce(expect);
      } while (heads_[current_] == kNoSlot);
      openBucket(order);
    }
  }

  struct Due {
    Slot slot;
    Real time;  // s
  };

  /// Takes out the ball whose event isDue() has just found.
  /// @param later  later(slot): decides between events of one order, the smaller goes first
  template <class Later>
  Due pop(Later later) {
    Entry first = firstAtHand();
    skip();
    if (isTied(first)) first = leastOfTies(first, later);
    agendas_[first.slot].previous = kNotQueued;
    --in_year_;
    return {first.slot, first.due};
  }

  /// Begins a new year; this one must be empty, and the clocks of the agendas moved already.
  template <class Order>
  void turnYear(Order order) {
    assert(in_year_ == 0);
    current_ = 0;
    clearBucket();
    Slot slot = beyond_;
    beyond_ = kNoSlot;
    while (slot != kNoSlot) {
      const Slot next = agendas_[slot].next;
      agendas_[slot].previous = kNotQueued;
      insert(slot, order);
      slot = next;
    }
  }

  /// The earliest time of all events beyond the year; infinity when there are none.
  Real earliestBeyond() const {
    Real earliest = std::numeric_limits<Real>::infinity();
    for (Slot slot = beyond_; slot != kNoSlot; slot = agendas_[slot].next) {
      earliest = std::min(earliest, agendas_[slot].due());
    }
    return earliest;
  }

 private:
  static constexpr std::uint32_t kFarAhead = 4;
  static constexpr std::size_t kSmall = 32;  // entries of a bucket
  // Up to so many balls all is in the cache anyway, and to fetch ahead would only cost.
  static constexpr std::size_t kCachedBalls = 20000;

  struct Entry {
    Real due;
    BallId order;
    Slot slot;
    std::uint32_t stamp;  // tells it from those that the ball has left behind

    bool operator<(const Entry& other) const {
      return due != other.due ? due < other.due : order < other.order;
    }
    bool ties(const Entry& other) const { return (due == other.due) & (order == other.order); }
  };
  // The standard heap has the largest on top.
  static bool isLater(const Entry& a, const Entry& b) { return b < a; }

  bool isBeyondYear(Real due) const { return !(due < yearLength()); }
  std::uint32_t bucketOf(Real due) const {
    const auto bucket = due > 0 ? static_cast<std::uint32_t>(due * per_width_) : 0;
    return std::min(bucket, buckets_ - 1);  // 1/width is rounded
  }

  // A ball comes to the bucket at hand.
  template <class Order>
  Entry entryOf(Slot slot, Order order) {
    Agenda<Real>& agenda = agendas_[slot];
    agenda.previous = kAtHand;
    agenda.next = ++stamps_;
    return {agenda.due(), order(slot), slot, stamps_};
  }

  // Not left behind by a ball that was taken out, perhaps to come back with another event.
  bool isLive(const Entry& entry) const {
    const Agenda<Real>& agenda = agendas_[entry.slot];
    return agenda.previous == kAtHand && agenda.next == entry.stamp;
  }

  // --- the bucket at hand

  void clearBucket() {
    sorted_.clear();
    position_ = 0;
    late_.clear();
  }

  bool lateIsFirst() const {
    return !late_.empty() && (position_ == sorted_.size() || late_.front() < sorted_[position_]);
  }
  const Entry& firstAtHand() const { return lateIsFirst() ? late_.front() : sorted_[position_]; }

  void skip() {
    if (!lateIsFirst()) {
      ++position_;
      return;
    }
    std::pop_heap(late_.begin(), late_.end(), isLater);
    late_.pop_back();
  }

  bool isTied(const Entry& entry) const {
    return (position_ < sorted_.size() && sorted_[position_].ties(entry)) ||
           (!late_.empty() && late_.front().ties(entry));
  }

  // Of the live entries that tie with `first`, the one to go first; the others stay.
  template <class Later>
  Entry leastOfTies(const Entry& first, Later later) {
    tied_.assign(1, first);
    while (isTied(first)) {
      if (isLive(firstAtHand())) tied_.push_back(firstAtHand());
      skip();
    }
    const auto least =
        std::min_element(tied_.begin(), tied_.end(), [&](const Entry& a, const Entry& b) {
          return later(a.slot) != later(b.slot) ? later(a.slot) < later(b.slot) : a.slot < b.slot;
        });
    const Entry found = *least;
    for (const Entry& entry : tied_) {
      if (entry.slot == found.slot) continue;
      late_.push_back(entry);
      std::push_heap(late_.begin(), late_.end(), isLater);
    }
    return found;
  }

  template <class Order>
  void openBucket(Order order) {
    sorted_.clear();
    for (Slot slot = heads_[current_], next; slot != kNoSlot; slot = next) {
      next = agendas_[slot].next;
      sorted_.push_back(entryOf(slot, order));
    }
    heads_[current_] = kNoSlot;
    position_ = 0;
    if (sorted_.size() > kSmall || !sortByCounting()) std::sort(sorted_.begin(), sorted_.end());
  }

  // A small bucket is sorted by counting for each entry how many come before it: there is no branch
  // in this to be foretold wrongly.
  // @return false, and nothing sorted, when two are due at one instant
  bool sortByCounting() {
    const std::size_t count = sorted_.size();
    std::array<Real, kSmall> due;
    std::array<Entry, kSmall> unsorted;
    for (std::size_t i = 0; i < count; ++i) {
      unsorted[i] = sorted_[i];
      due[i] = sorted_[i].due;
    }
    std::size_t pairs = 0;  // in order; all of them, unless some are due together
    for (std::size_t i = 0; i < count; ++i) {
      std::size_t before = 0;
      for (std::size_t j = 0; j < count; ++j) before += due[j] < due[i] ? 1 : 0;
      sorted_[before] = unsorted[i];
      pairs += before;
    }
    if (2 * pairs == count * (count - 1)) return true;
    std::copy_n(unsorted.begin(), count, sorted_.begin());
    return false;
  }

  template <class Expect>
  void announce(Expect expect) {
    const Slot far = heads_[current_ + kFarAhead];
    if (far != kNoSlot) __builtin_prefetch(&agendas_[far]);
    for (const std::uint32_t ahead : {kSoon, kSooner, kNext}) {
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
  HugePageVector<Slot> heads_;  // of the buckets' lists
  Slot beyond_ = kNoSlot;       // head of the list of events beyond the year
  std::uint32_t buckets_ = 0;
  std::uint32_t current_ = 0;
  std::vector<Entry> sorted_;  // the bucket at hand
  std::size_t position_ = 0;   // of the next in sorted_
  std::vector<Entry> late_;    // heap of those that came late into the bucket at hand
  std::vector<Entry> tied_;    // scratch of leastOfTies()
  std::uint32_t stamps_ = 0;   // the last one given
  std::size_t in_year_ = 0;    // events queued that are not beyond the year
};

}  // namespace ball_sim::core
