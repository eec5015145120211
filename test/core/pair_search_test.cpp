// The search for the earliest impact with any of a list, in every kind of instructions that this
// processor has: bit by bit what timeOfImpact() tells pair by pair.
#include "event_driven/pair_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr std::size_t kLongest = 40;  // of the lists: five steps of the widest lanes

struct Case {
  std::vector<Body<double>> bodies;
  std::vector<Slot> slots;  // `count` of them, and then what may be loaded too
  std::size_t count = 0;
  Seeker<double> seeker{};
  PairSpace<double> space;
};

// Sixteenths, so that two balls often have the very same wait; or any number.
double coordinate(RandomNumbers& random, bool coarse, double size) {
  const double any = random.uniform(-size, size);
  return coarse ? std::floor(16 * any) / 16 : any;
}

Vector3 vectorOf(RandomNumbers& random, bool coarse, double size) {
  const double x = coordinate(random, coarse, size);
  const double y = coordinate(random, coarse, size);
  const double z = coordinate(random, coarse, size);
  return {x, y, z};
}

Case randomCase(RandomNumbers& random, bool wraps, bool falls) {
  Case made;
  const bool coarse = random.chance(0.5);
  const double largest = random.chance(0.5) ? 0.25 : 1;  // some meet, or many overlap
  if (wraps) {
    made.space.period = Vector3(2, 3, random.chance(0.5) ? 0 : 1.7);
    for (int axis = 0; axis < 3; ++axis) {
      const double period = made.space.period[axis];
      made.space.per_period[axis] = period > 0 ? 1 / period : 0;
    }
  }
  if (falls) made.space.fall = vectorOf(random, coarse, 5);
  const double now = coarse ? 0.5 : random.uniform(0, 1);
  for (std::size_t i = 0; i < kLongest; ++i) {
    Body<double> body;
    body.x = vectorOf(random, coarse, 1.5);
    body.v = vectorOf(random, coarse, 1);
    body.time = coarse ? 0 : random.uniform(0, now);
    body.radius = coarse ? largest / 2 : random.uniform(0, largest);
    if (i > 0 && random.chance(0.1)) body = made.bodies[random.index(i)];  // a tie, if they meet
    made.bodies.push_back(body);
  }
  made.count = random.index(kLongest + 1);
  for (std::size_t i = 0; i < made.count + kSearchStep; ++i) {
    made.slots.push_back(static_cast<Slot>(random.index(kLongest)));
  }
  made.seeker.x = vectorOf(random, coarse, 1);
  made.seeker.v = vectorOf(random, coarse, 1);
  made.seeker.radius = coarse ? largest / 2 : random.uniform(0, largest);
  made.seeker.now = now;
  return made;
}

double waitFor(const Case& given, const Body<double>& body) {
  const double dt = given.seeker.now - body.time;
  const Vector3& fall = given.space.fall;
  Vector3 dx = body.x + dt * (body.v + (dt / 2) * fall) - given.seeker.x;
  for (int axis = 0; axis < 3; ++axis) {
    dx[axis] -= std::nearbyint(dx[axis] * given.space.per_period[axis]) * given.space.period[axis];
  }
  const Vector3 dv = body.v + dt * fall - given.seeker.v;
  return timeOfImpact<double>(dx, dv, body.radius + given.seeker.radius);
}

/// What the searches of many random lists came to: a test of nothing but misses would be none.
struct Tally {
  int hits = 0;
  int ties = 0;
  int now = 0;  // overlapping and approaching
};

void expectEarliest(const Case& given, PairSearch<double> search, Tally& tally) {
  std::vector<double> waits;
  double earliest = kNever<double>;
  for (std::size_t i = 0; i < given.count; ++i) {
    waits.push_back(waitFor(given, given.bodies[given.slots[i]]));
    earliest = std::min(earliest, waits.back());
  }
  const PairHit<double> hit =
      search(given.bodies.data(), given.slots.data(), given.count, given.seeker, given.space);
  ASSERT_EQ(hit.wait, earliest);
  if (earliest == kNever<double>) {
    ASSERT_FALSE(hit.tied);
    return;
  }
  const bool tied = std::count(waits.begin(), waits.end(), earliest) > 1;
  ASSERT_EQ(hit.tied, tied);
  ASSERT_LT(hit.index, given.count);
  ASSERT_EQ(waits[hit.index], earliest);
  ++tally.hits;
  tally.ties += tied ? 1 : 0;
  tally.now += earliest == 0 ? 1 : 0;
}

TEST(PairSearch, EveryInstructionSetFindsWhatThePairsTell) {
  for (const bool wraps : {false, true}) {
    for (const bool falls : {false, true}) {
      const auto searches = pairSearches<double>(wraps, falls);
      ASSERT_EQ(choosePairSearch<double>(wraps, falls, kSearchStep), searches.front());
      for (std::size_t k = 0; k < searches.size(); ++k) {
        SCOPED_TRACE(testing::Message() << "wraps " << wraps << ", falls " << falls << ", kind "
                                        << k << " of " << searches.size());
        RandomNumbers random(1);
        Tally tally;
        for (int i = 0; i < 4000 && !HasFatalFailure(); ++i) {
          expectEarliest(randomCase(random, wraps, falls), searches[k], tally);
        }
        EXPECT_GT(tally.hits, 1000);
        EXPECT_GT(tally.ties, 200);
        EXPECT_GT(tally.now, 200);
      }
    }
  }
}

TEST(PairSearch, TheSeekerItselfIsNeverMet) {
  for (const PairSearch<double> search : pairSearches<double>(true, true)) {
    RandomNumbers random(2);
    Case given = randomCase(random, true, true);
    const Body<double>& self = given.bodies[given.slots[0]];
    given.count = 1;
    given.seeker = {self.x, self.v, self.radius, self.time};
    const PairHit<double> hit =
        search(given.bodies.data(), given.slots.data(), given.count, given.seeker, given.space);
    EXPECT_EQ(hit.wait, kNever<double>);
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
