// Balls in another order in memory: the order follows a space-filling curve, and every ball takes
// all that is its own along.
#include "event_driven/memory_order.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <vector>

#include "event_driven/flights.hpp"
#include "event_driven/neighbour_lists.hpp"
#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace test {
namespace {

using Places = std::vector<Vector3>;

/// Evenly in a box with a corner at the origin.
Places evenly(std::size_t count, const Vector3& size) {
  RandomNumbers random(1);
  Places places(count);
  for (Vector3& x : places) {
    for (int k = 0; k < 3; ++k) x[k] = random.uniform(0, size[k]);
  }
  return places;
}

std::vector<std::uint32_t> numbersOf(const Places& places, const std::vector<bool>& gone) {
  std::vector<std::uint32_t> numbers(places.size());
  MemoryOrder().number([&](std::uint32_t i) { return places[i]; },
                       [&](std::uint32_t i) { return bool{gone[i]}; }, numbers);
  return numbers;
}

/// How far, m, balls are from the ones that are `step` further on in memory: the median.
double usualStep(const Places& places, std::size_t step) {
  const auto numbers = numbersOf(places, std::vector<bool>(places.size(), false));
  Places sorted(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) sorted[numbers[i]] = places[i];
  std::vector<double> steps;
  for (std::size_t i = 0; i + step < sorted.size(); ++i) {
    steps.push_back((sorted[i + step] - sorted[i]).norm());
  }
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

std::vector<Slot> shuffled(std::size_t count) {
  RandomNumbers random(2);
  std::vector<Slot> to(count);
  std::iota(to.begin(), to.end(), Slot{0});
  for (std::size_t i = count; i > 1; --i) std::swap(to[i - 1], to[random.index(i)]);
  return to;
}

TEST(SpaceCurve, goesThroughEveryBrickOnce) {
  const Vector3 low(-3, 5, 7);
  const Vector3 size(8, 4, 0);  // planar: halved into 16 x 8 x 1
  const SpaceCurve<double> curve(low, size, 7);
  ASSERT_EQ(curve.bricks(), 128u);
  std::set<std::uint32_t> bricks;
  for (int x = 0; x < 16; ++x) {
    for (int y = 0; y < 8; ++y) {
      const std::uint32_t brick = curve.brickAt(low + Vector3(x + 0.5, y + 0.5, 0) / 2);
      EXPECT_EQ(brick >= 64, x >= 8) << "one half after the other";
      bricks.insert(brick);
    }
  }
  EXPECT_EQ(bricks.size(), 128u);
  EXPECT_EQ(*bricks.rbegin(), 127u);
}

TEST(MemoryOrder, numbersEveryBallOnceAndThoseThatAreGoneLast) {
  const Places places = evenly(1000, Vector3(1, 1, 1));
  std::vector<bool> gone(places.size(), false);
  for (std::size_t i = 0; i < places.size(); i += 10) gone[i] = true;
  const auto numbers = numbersOf(places, gone);
  const std::set<std::uint32_t> all(numbers.begin(), numbers.end());
  EXPECT_EQ(all.size(), places.size());
  EXPECT_EQ(*all.rbegin(), places.size() - 1);
  for (std::size_t i = 0; i < places.size(); ++i) EXPECT_EQ(numbers[i] >= 900, gone[i]) << i;
}

TEST(MemoryOrder, thereMayBeNoBallAtAllOrOne) {
  EXPECT_TRUE(numbersOf({}, {}).empty());
  EXPECT_EQ(numbersOf({Vector3(1, 2, 3)}, {false}), std::vector<std::uint32_t>{0});
}

// With a ball per m^3 a brick of 8 to 16 balls has edges of 2 to 2.5 m, or one of twice that and
// shorter ones, and of 4 m in the plane. Two balls evenly in a cube are 0.66 edges apart on
// average, in a square 0.52, in the next brick up to twice that. At random in memory it would be 16
// m in the cube, 65 m in the plane, 700 m in the rod.
TEST(MemoryOrder, neighboursInMemoryAreNeighboursInSpace) {
  const Places cube = evenly(15625, Vector3(25, 25, 25));
  EXPECT_LT(usualStep(cube, 1), 2.5);
  EXPECT_LT(usualStep(cube, 8), 5);
  EXPECT_LT(usualStep(evenly(15625, Vector3(125, 125, 0)), 1), 4);
  EXPECT_LT(usualStep(evenly(15625, Vector3(2.5, 2.5, 2500)), 1), 2.5);
}

// One that has flown a hundred times as far as all others are wide makes the box, and so the
// bricks, (1 + 12 * 100^2 / 15625)^(1/2) = 3 times as wide on its axis.
TEST(MemoryOrder, oneThatIsFarAwayDoesNotSpoilIt) {
  Places places = evenly(15625, Vector3(25, 25, 25));
  places[7] = Vector3(2500, 0, 0);
  EXPECT_LT(usualStep(places, 1), 2 * 2.5);
}

TEST(MemoryOrder, aBallTakesAllThatIsItsOwnAlong) {
  constexpr std::size_t kBalls = 100;
  Surroundings surroundings;
  surroundings.gravity = Vector3(0, 0, -1);
  surroundings.restitution = 0.5;
  Flights<double, true> flights(surroundings);
  flights.resize(kBalls);
  for (Slot slot = 0; slot < kBalls; ++slot) {
    flights.bodies[slot].radius = slot;
    flights.agendas[slot].id = slot;
    flights.histories[slot].quick = slot;
    if (slot % 2 == 0) flights.contacts.rest(slot, static_cast<int>(slot % 4));
  }
  const std::vector<Slot> to = shuffled(kBalls);
  flights.moveTo(to);
  for (Slot slot = 0; slot < kBalls; ++slot) {
    const Slot now = to[slot];
    EXPECT_EQ(flights.bodies[now].radius, slot);
    EXPECT_EQ(flights.agendas[now].id, slot);
    EXPECT_EQ(flights.histories[now].quick, slot);
    EXPECT_EQ(flights.contacts.isRestingOn(now, 0), slot % 4 == 0);
    EXPECT_EQ(flights.contacts.isRestingOn(now, 2), slot % 4 == 2);
  }
}

TEST(MemoryOrder, neighbourListsNameTheBallsByTheirNewSlots) {
  constexpr std::size_t kBalls = 1000;
  Regions regions;
  regions.width = {10, 10, 10};
  regions.round = {1000, 1000, 1000};
  regions.spacing = {1, 1, 1};
  regions.reach = 100;  // about six neighbours a ball
  NeighbourLists lists;
  lists.reset(kBalls, regions);
  RandomNumbers random(3);
  const auto coordinate = [&] { return static_cast<std::int32_t>(random.index(1000)); };
  for (Slot slot = 0; slot < kBalls; ++slot) {
    lists.setHome(slot, {coordinate(), coordinate(), coordinate()});
  }
  std::vector<Slot> all(kBalls);
  std::iota(all.begin(), all.end(), Slot{0});
  for (const Slot slot : all) lists.fill(slot, all.data(), all.size());

  NeighbourLists sorted = lists;
  const std::vector<Slot> to = shuffled(kBalls);
  sorted.renumber(to, kBalls);
  std::size_t neighbours = 0;
  for (const Slot slot : all) {
    EXPECT_EQ(sorted.home(to[slot]), lists.home(slot));
    std::vector<Slot> expected(lists.of(slot), lists.of(slot) + lists.count(slot));
    for (Slot& other : expected) other = to[other];
    const Slot* const list = sorted.of(to[slot]);
    EXPECT_EQ(std::vector<Slot>(list, list + sorted.count(to[slot])), expected);
    neighbours += expected.size();
  }
  EXPECT_GT(neighbours, 4 * kBalls);
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
