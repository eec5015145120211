// The event queue gives balls out in order of time, and of those at one instant the first first:
// compared with the standard library's ordered set.
#include "event_driven/event_queue.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <utility>

namespace ball_sim::core {
namespace test {
namespace {

struct LargestFirst {
  bool operator()(Slot a, Slot b) const { return a > b; }
};
// By time, then as LargestFirst has it.
using Expected = std::set<std::pair<double, int>>;

class Queue {
 public:
  // @param width  of a bucket, s
  Queue(std::size_t balls, double width, std::uint32_t buckets)
      : agendas_(balls), queue_(agendas_, LargestFirst()) {
    queue_.reset(width, buckets);
  }

  void insert(Slot slot, double due) {
    agendas_[slot].impact_time = due;
    queue_.insert(slot);
    expected_.emplace(due, -static_cast<int>(slot));
  }

  void remove(Slot slot) {
    queue_.remove(slot);
    expected_.erase({agendas_[slot].due(), -static_cast<int>(slot)});
  }

  // Takes out the next, which must be the one expected, if any is due.
  // @return its slot, or kNoSlot
  Slot next(double limit) {
    const bool is_due = queue_.isDue(limit, [](Slot, std::uint32_t) {});
    const bool should_be = !expected_.empty() && expected_.begin()->first <= limit &&
                           expected_.begin()->first < queue_.yearLength();
    EXPECT_EQ(is_due, should_be);
    if (!is_due || !should_be) return kNoSlot;
    const auto due = queue_.pop();
    EXPECT_EQ(due.time, expected_.begin()->first);
    EXPECT_EQ(static_cast<int>(due.slot), -expected_.begin()->second);
    expected_.erase(expected_.begin());
    return due.slot;
  }

  bool empty() const { return expected_.empty(); }
  double yearLength() const { return queue_.yearLength(); }
  double dueOf(Slot slot) const { return agendas_[slot].due(); }

  // A year passes; what is queued comes a year sooner.
  void turnYear() {
    const double year = queue_.yearLength();
    Expected moved;
    for (const auto& [due, slot] : expected_) moved.emplace(due - year, slot);
    expected_ = std::move(moved);
    for (auto& agenda : agendas_) agenda.impact_time -= year;
    queue_.turnYear();
  }

 private:
  HugePageVector<Agenda<double>> agendas_;
  EventQueue<double, LargestFirst> queue_;
  Expected expected_;
};

// Balls come, go and come again at random times on a coarse grid, so that many are due together.
TEST(EventQueue, givesOutInOrder) {
  std::mt19937 random(1);
  const auto below = [&random](std::uint32_t n) {
    return static_cast<std::uint32_t>(random() % n);
  };
  Queue queue(500, 0.5, 64);
  double now = 0;
  const auto later = [&] { return now + below(400) / 8.0; };  // up to 50 s in a year of 32 s
  for (Slot slot = 0; slot < 500; ++slot) queue.insert(slot, later());
  for (int i = 0; i < 50000 && !testing::Test::HasFailure(); ++i) {
    const Slot slot = queue.next(queue.yearLength());
    if (slot == kNoSlot) {
      queue.turnYear();
      now -= queue.yearLength();
      continue;
    }
    now = std::max(now, queue.dueOf(slot));
    queue.insert(slot, later());
    const Slot other = below(500);
    queue.remove(other);
    queue.insert(other, below(4) == 0 ? now : later());
  }
}

TEST(EventQueue, holdsAnyNumberAtOneInstant) {
  Queue queue(5000, 1, 8);
  for (Slot slot = 0; slot < 5000; ++slot) queue.insert(slot, 3.25);
  queue.remove(4321);
  for (int i = 0; i < 4999; ++i) ASSERT_NE(queue.next(4), kNoSlot);
  EXPECT_EQ(queue.next(8), kNoSlot);
}

// A ball that is taken out and put in again very often within one bucket, as a light ball between
// a heavy one and a wall: none of its former events may come back.
TEST(EventQueue, forgetsWhatWasTakenOut) {
  Queue queue(3, 1, 8);
  queue.insert(0, 0.9375);
  double now = 0;
  for (int i = 0; i < 100000; ++i) {
    queue.insert(1, now + 0x1p-18);
    queue.insert(2, now + 0x1p-17);
    ASSERT_EQ(queue.next(1), Slot{1});
    queue.remove(2);
    now += 0x1p-18;
  }
  EXPECT_EQ(queue.next(1), Slot{0});
  EXPECT_TRUE(queue.empty());
}

TEST(EventQueue, findsNothingBeforeTheLimit) {
  Queue queue(2, 1, 8);
  queue.insert(0, 2.5);
  EXPECT_EQ(queue.next(2.25), kNoSlot);
  queue.insert(1, 2.25);  // into the bucket at hand
  EXPECT_EQ(queue.next(2.25), Slot{1});
  EXPECT_EQ(queue.next(2.5), Slot{0});
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
