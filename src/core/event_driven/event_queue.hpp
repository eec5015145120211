// The event queue: one event a ball, in a calendar of buckets.
//
// Events of the current year wait in the bucket of their time, unsorted; only the bucket at hand is
// kept in order, in a small heap; events beyond the year wait in one list until it turns. Both
// insertion and removal are O(1) (Paul, "A complexity O(1) priority queue for event driven
// molecular dynamics simulations", 2007). Nothing is allocated per event: a ball's entry is a pair
// of links.
//
// Times are seconds since the year began. When the year turns the owner moves its clocks back by
// yearLength(), a power of two, so that times stay small and fine however long the run is.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <vector>

namespace ball_sim {

/// Index of a ball in a method's arrays.
using Slot = std::uint32_t;
constexpr Slot kNoSlot = ~Slot{0};

/// A ball's place in the queue.
struct QueueLinks {
  static constexpr std::int32_t kNotQueued = -1;
  static constexpr std::int32_t kInHeap = -2;
  static constexpr std::int32_t kBeyondYear = -3;

  Slot next = kNoSlot;
  Slot previous = kNoSlot;
  std::int32_t bucket = kNotQueued;  ///< or one of the marks above
};

/// @tparam Entries  gives `Real due(Slot)`, the time of a ball's event; `QueueLinks& links(Slot)`;
///                  and `bool before(Slot, Slot)`, the order of events at one instant
template <class Real, class Entries>
class EventQueue {
 public:
  /// Forgets all entries and sets the calendar.
  /// @param bucket_width  s, a power of two
  /// @param buckets       a power of two
  void reset(Real bucket_width, std::uint32_t buckets) {
    width_ = bucket_width;
    per_width_ = 1 / bucket_width;
    heads_.assign(buckets, kNoSlot);
    beyond_ = kNoSlot;
    current_ = 0;
    heap_.clear();
    heap_.reserve(256);
    in_year_ = 0;
  }

  Real yearLength() const { return width_ * Real(heads_.size()); }
  Real bucketWidth() const { return width_; }
  std::size_t bytes() const {
    return heads_.capacity() * sizeof(Slot) + heap_.capacity() * sizeof(HeapEntry);
  }

  /// Adds a ball that is not queued, at entries.due(slot) >= the time of the last event.
  void insert(Entries& entries, Slot slot) {
    const Real due = entries.due(slot);
    const Real position = due * per_width_;
    if (!(position < Real(heads_.size()))) {
      link(entries, slot, beyond_, QueueLinks::kBeyondYear);
      return;
    }
    ++in_year_;
    const auto bucket = static_cast<std::uint32_t>(position);
    if (bucket <= current_) {
      pushHeap(entries, slot, due);
    } else {
      link(entries, slot, heads_[bucket], static_cast<std::int32_t>(bucket));
    }
  }

  /// Takes a ball out, queued or not.
  void remove(Entries& entries, Slot slot) {
    QueueLinks& links = entries.links(slot);
    if (links.bucket == QueueLinks::kNotQueued) return;
    if (links.bucket != QueueLinks::kBeyondYear) --in_year_;
    if (links.bucket != QueueLinks::kInHeap) unlink(entries, links);
    links.bucket = QueueLinks::kNotQueued;  // a heap entry that has lost its ball is skipped later
  }

  /// The ball whose event is next, if that is due by `limit`; kNoSlot if not, or if the year is
  /// over. The ball stays queued.
  Slot peek(Entries& entries, Real limit) {
    while (true) {
      while (!heap_.empty()) {
        const HeapEntry& top = heap_.front();
        if (isLive(entries, top)) return top.due <= limit ? top.slot : kNoSlot;
        popHeap(entries);
      }
      if (in_year_ == 0 || current_ + 1 == heads_.size()) return kNoSlot;
      if (Real(current_ + 1) * width_ > limit) return kNoSlot;
      ++current_;
      openBucket(entries);
    }
  }

  /// Takes out the ball that peek() just named.
  void pop(Entries& entries) {
    entries.links(heap_.front().slot).bucket = QueueLinks::kNotQueued;
    --in_year_;
    popHeap(entries);
  }

  /// Whether nothing is left to happen in this year.
  bool yearIsEmpty() const { return in_year_ == 0; }

  /// Begins a new year, after the owner has moved all times back; the year must be empty.
  void turnYear(Entries& entries) {
    assert(in_year_ == 0);
    current_ = 0;
    heap_.clear();
    Slot slot = beyond_;
    beyond_ = kNoSlot;
    while (slot != kNoSlot) {
      QueueLinks& links = entries.links(slot);
      const Slot next = links.next;
      links.bucket = QueueLinks::kNotQueued;
      insert(entries, slot);
      slot = next;
    }
  }

  /// The earliest time of all events beyond the year; infinity when there are none.
  Real earliestBeyond(Entries& entries) const {
    Real earliest = kNever<Real>;
    for (Slot slot = beyond_; slot != kNoSlot; slot = entries.links(slot).next) {
      earliest = std::min(earliest, entries.due(slot));
    }
    return earliest;
  }

 private:
  struct HeapEntry {
    Real due;
    Slot slot;
  };

  // The heap's top is the earliest; the entries decide among equal times.
  struct Later {
    Entries& entries;
    bool operator()(const HeapEntry& a, const HeapEntry& b) const {
      if (a.due != b.due) return a.due > b.due;
      return entries.before(b.slot, a.slot);
    }
  };

  bool isLive(Entries& entries, const HeapEntry& entry) const {
    return entries.links(entry.slot).bucket == QueueLinks::kInHeap &&
           entries.due(entry.slot) == entry.due;
  }

  void pushHeap(Entries& entries, Slot slot, Real due) {
    entries.links(slot).bucket = QueueLinks::kInHeap;
    heap_.push_back({due, slot});
    std::push_heap(heap_.begin(), heap_.end(), Later{entries});
  }

  void popHeap(Entries& entries) {
    std::pop_heap(heap_.begin(), heap_.end(), Later{entries});
    heap_.pop_back();
  }

  void openBucket(Entries& entries) {
    Slot slot = heads_[current_];
    heads_[current_] = kNoSlot;
    while (slot != kNoSlot) {
      QueueLinks& links = entries.links(slot);
      links.bucket = QueueLinks::kInHeap;
      heap_.push_back({entries.due(slot), slot});
      slot = links.next;
    }
    std::make_heap(heap_.begin(), heap_.end(), Later{entries});
  }

  void link(Entries& entries, Slot slot, Slot& head, std::int32_t bucket) {
    QueueLinks& links = entries.links(slot);
    links.bucket = bucket;
    links.previous = kNoSlot;
    links.next = head;
    if (head != kNoSlot) entries.links(head).previous = slot;
    head = slot;
  }

  void unlink(Entries& entries, const QueueLinks& links) {
    if (links.next != kNoSlot) entries.links(links.next).previous = links.previous;
    if (links.previous != kNoSlot) {
      entries.links(links.previous).next = links.next;
    } else if (links.bucket == QueueLinks::kBeyondYear) {
      beyond_ = links.next;
    } else {
      heads_[static_cast<std::size_t>(links.bucket)] = links.next;
    }
  }

  Real width_ = 1;
  Real per_width_ = 1;
  std::vector<Slot> heads_;  // of the buckets' lists
  Slot beyond_ = kNoSlot;    // head of the list of events beyond the year
  std::uint32_t current_ = 0;
  std::vector<HeapEntry> heap_;  // events of the current bucket and those that came late into it
  std::size_t in_year_ = 0;      // events in buckets and heap
};

}  // namespace ball_sim
