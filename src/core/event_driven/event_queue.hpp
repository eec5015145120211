// The event queue: one event a ball, in a calendar of buckets.
//
// Events of the current year wait in the bucket of their time, unsorted; only the bucket at hand is
// kept in order, in a small heap; events beyond the year wait in one list until it turns. Both
// insertion and removal are O(1) (Paul, "A complexity O(1) priority queue for event driven
// molecular dynamics simulations", 2007). Nothing is allocated per event: a ball's entry is a pair
// of links.
//
// Times are seconds since the year began. When the year turns the owner moves its clocks back by
// whole years, a power of two each, so that times stay small and fine however long the run is.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "event_driven/huge_page_vector.hpp"

namespace ball_sim::core {

/// Index of a ball in a method's arrays.
using Slot = std::uint32_t;
constexpr Slot kNoSlot = ~Slot{0};

/// Decides between events at one instant; the smaller goes first.
using TieOrder = std::pair<std::int64_t, std::int64_t>;

/// @tparam Real  double or long double
template <class Real>
class EventQueue {
 public:
  /// How many buckets ahead a ball is announced, each time for the next step of the fetching.
  static constexpr std::uint32_t kSoon = 8;
  static constexpr std::uint32_t kSooner = 5;
  static constexpr std::uint32_t kNext = 2;

  /// Forgets all entries and sets the calendar.
  /// @param bucket_width  s, a power of two
  /// @param buckets       a power of two
  /// @param slots         size of the owner's arrays
  void reset(Real bucket_width, std::uint32_t buckets, std::size_t slots) {
    width_ = bucket_width;
    per_width_ = 1 / bucket_width;
    buckets_ = buckets;
    heads_.assign(buckets + kFarAhead, kNoSlot);  // one can look ahead without asking
    entries_.assign(slots, Entry{});
    beyond_ = kNoSlot;
    current_ = 0;
    heap_.clear();
    heap_.reserve(256);
    in_year_ = 0;
  }

  /// Makes room for slots up to `slots`.
  void resize(std::size_t slots) { entries_.resize(slots); }

  Real yearLength() const { return width_ * Real(buckets_); }
  Real bucketWidth() const { return width_; }
  std::size_t bytes() const {
    return heads_.capacity() * sizeof(Slot) + entries_.capacity() * sizeof(Entry) +
           heap_.capacity() * sizeof(HeapEntry);
  }

  /// Adds a ball that is not queued.
  /// @param due    s in this year, not before the last event taken out
  /// @param order  order(slot) gives the TieOrder of a ball's event
  template <class Order>
  void insert(Slot slot, Real due, Order order) {
    entries_[slot].due = due;
    const Real position = due * per_width_;
    if (!(position < Real(buckets_))) {
      link(slot, beyond_, kBeyondYear);
      return;
    }
    ++in_year_;
    const auto bucket = static_cast<std::uint32_t>(position);
    if (bucket <= current_) {
      addToHeap(slot, order);
      std::push_heap(heap_.begin(), heap_.end());
    } else {
      link(slot, heads_[bucket], static_cast<std::int32_t>(bucket));
    }
  }

  /// Takes a ball out, queued or not.
  void remove(Slot slot) {
    Entry& entry = entries_[slot];
    if (entry.bucket == kNotQueued) return;
    if (entry.bucket != kBeyondYear) --in_year_;
    if (entry.bucket != kInHeap) unlink(entry);
    entry.bucket = kNotQueued;  // what the heap holds of it is skipped later
  }

  /// The ball whose event is next, if that is due by `limit`; kNoSlot if not, or if the year is
  /// over. The ball stays queued.
  /// @param expect  expect(slot, buckets ahead): a ball comes up kSoon, kSooner, kNext
  template <class Order, class Expect>
  Slot peek(Real limit, Order order, Expect expect) {
    while (true) {
      while (!heap_.empty()) {
        const HeapEntry& top = heap_.front();
        if (isLive(top)) return top.due <= limit ? top.slot : kNoSlot;
        popHeap();
      }
      if (in_year_ == 0 || current_ + 1 == buckets_) return kNoSlot;
      if (Real(current_ + 1) * width_ > limit) return kNoSlot;
      ++current_;
      openBucket(order, expect);
    }
  }

  /// Takes out the ball that peek() just named, and tells when it was due.
  Real pop() {
    const HeapEntry top = heap_.front();
    entries_[top.slot].bucket = kNotQueued;
    --in_year_;
    popHeap();
    return top.due;
  }

  /// Begins a new year `by` seconds later; this one must be empty.
  /// @param by  whole years
  template <class Order>
  void turnYear(Real by, Order order) {
    assert(in_year_ == 0);
    current_ = 0;
    heap_.clear();
    Slot slot = beyond_;
    beyond_ = kNoSlot;
    while (slot != kNoSlot) {
      Entry& entry = entries_[slot];
      const Slot next = entry.next;
      entry.bucket = kNotQueued;
      insert(slot, entry.due - by, order);
      slot = next;
    }
  }

  /// The earliest time of all events beyond the year; infinity when there are none.
  Real earliestBeyond() const {
    Real earliest = std::numeric_limits<Real>::infinity();
    for (Slot slot = beyond_; slot != kNoSlot; slot = entries_[slot].next) {
      earliest = std::min(earliest, entries_[slot].due);
    }
    return earliest;
  }

 private:
  static constexpr std::int32_t kNotQueued = -1;
  static constexpr std::int32_t kInHeap = -2;
  static constexpr std::int32_t kBeyondYear = -3;

  static constexpr std::uint32_t kFarAhead = 12;
  // Up to so many balls all is in the cache anyway, and to fetch ahead would only cost.
  static constexpr std::size_t kCachedEntries = 20000;

  struct Entry {
    Real due = 0;  // s, in this year
    Slot next = kNoSlot;
    Slot previous = kNoSlot;
    std::int32_t bucket = kNotQueued;  // or one of the marks above
    std::uint32_t stamp = 0;           // tells the heap's entry from those left behind
  };

  struct HeapEntry {
    Real due;
    TieOrder order;
    Slot slot;
    std::uint32_t stamp;

    // The standard heap has the largest on top: the earliest is the largest.
    bool operator<(const HeapEntry& other) const {
      return due != other.due ? due > other.due : order > other.order;
    }
  };

  bool isLive(const HeapEntry& top) const {
    const Entry& entry = entries_[top.slot];
    return entry.bucket == kInHeap && entry.stamp == top.stamp;
  }

  template <class Order>
  void addToHeap(Slot slot, Order order) {
    Entry& entry = entries_[slot];
    entry.bucket = kInHeap;
    heap_.push_back({entry.due, order(slot), slot, ++entry.stamp});
  }

  void popHeap() {
    std::pop_heap(heap_.begin(), heap_.end());
    heap_.pop_back();
  }

  template <class Order, class Expect>
  void openBucket(Order order, Expect expect) {
    if (entries_.size() > kCachedEntries) announce(expect);
    for (Slot slot = heads_[current_]; slot != kNoSlot; slot = entries_[slot].next) {
      addToHeap(slot, order);
    }
    heads_[current_] = kNoSlot;
    std::make_heap(heap_.begin(), heap_.end());
  }

  template <class Expect>
  void announce(Expect expect) {
    const Slot far = heads_[current_ + kFarAhead];
    if (far != kNoSlot) __builtin_prefetch(&entries_[far]);
    for (const std::uint32_t ahead : {kSoon, kSooner, kNext}) {
      for (Slot s = heads_[current_ + ahead]; s != kNoSlot; s = entries_[s].next) expect(s, ahead);
    }
  }

  void link(Slot slot, Slot& head, std::int32_t bucket) {
    Entry& entry = entries_[slot];
    entry.bucket = bucket;
    entry.previous = kNoSlot;
    entry.next = head;
    if (head != kNoSlot) entries_[head].previous = slot;
    head = slot;
  }

  void unlink(const Entry& entry) {
    if (entry.next != kNoSlot) entries_[entry.next].previous = entry.previous;
    if (entry.previous != kNoSlot) {
      entries_[entry.previous].next = entry.next;
    } else if (entry.bucket == kBeyondYear) {
      beyond_ = entry.next;
    } else {
      heads_[static_cast<std::size_t>(entry.bucket)] = entry.next;
    }
  }

  Real width_ = 1;
  Real per_width_ = 1;
  HugePageVector<Slot> heads_;     // of the buckets' lists
  HugePageVector<Entry> entries_;  // by slot
  Slot beyond_ = kNoSlot;          // head of the list of events beyond the year
  std::uint32_t buckets_ = 0;
  std::uint32_t current_ = 0;
  std::vector<HeapEntry> heap_;  // events of the current bucket and those that came late into it
  std::size_t in_year_ = 0;      // events in buckets and heap
};

}  // namespace ball_sim::core
