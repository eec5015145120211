// Neighbour lists stay what they should be, short or long, while homes change, balls come and go
// and get other slots: every list names those balls whose regions come within reach of its own.
#include "event_driven/neighbour_lists.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <vector>

#include "support/random_numbers.hpp"

namespace ball_sim::core {
namespace test {
namespace {

using Balls = std::vector<Slot>;

constexpr std::size_t kBalls = 90;
constexpr int kRound = 64;  // points of the lattice, once round the periodic box
constexpr int kWidth = 3;   // points, edge of a region
constexpr double kSpacing = 0.1;

class NeighbourListsTest : public ::testing::Test {
 protected:
  NeighbourListsTest() : homes_(kBalls), is_there_(kBalls, false) {
    Regions regions;
    for (std::size_t k = 0; k < 3; ++k) {
      regions.width[k] = kWidth;
      regions.round[k] = kRound;
      regions.spacing[k] = static_cast<float>(kSpacing);
    }
    regions.reach = 1.03F;  // no distance between regions comes near it
    lists_.reset(kBalls, regions);
    for (Slot slot = 0; slot < kBalls; ++slot) come(slot);
  }

  /// Gives a ball a home near others, across the box's edge perhaps, or far from most.
  void come(Slot slot) {
    const int spread = random_.chance(0.5) ? 10 : kRound;
    for (std::int32_t& at : homes_[slot]) {
      at = static_cast<std::int32_t>(random_.index(static_cast<std::size_t>(spread)));
      at = (at + kRound - 5) % kRound;
    }
    is_there_[slot] = true;
    lists_.setHome(slot, homes_[slot]);
    lists_.renew(slot, there().data(), there().size());
  }

  void go(Slot slot) {
    lists_.renew(slot, nullptr, 0);
    is_there_[slot] = false;
  }

  void giveOtherSlots() {
    std::vector<Slot> to(kBalls);
    std::iota(to.begin(), to.end(), Slot{0});
    for (std::size_t i = kBalls - 1; i > 0; --i) std::swap(to[i], to[random_.index(i + 1)]);
    lists_.renumber(to, kBalls);
    auto homes = homes_;
    auto is_there = is_there_;
    for (Slot slot = 0; slot < kBalls; ++slot) {
      homes_[to[slot]] = homes[slot];
      is_there_[to[slot]] = is_there[slot];
    }
  }

  Balls there() const {
    Balls there;
    for (Slot slot = 0; slot < kBalls; ++slot) {
      if (is_there_[slot]) there.push_back(slot);
    }
    return there;
  }

  bool areNear(Slot a, Slot b) const {
    double squares = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const int straight = std::abs(homes_[a][k] - homes_[b][k]);
      const int gap = std::max(std::min(straight, kRound - straight) - kWidth, 0);
      squares += gap * kSpacing * gap * kSpacing;
    }
    return squares < 1.03 * 1.03;
  }

  Balls expected(Slot slot) const {
    Balls near;
    for (const Slot other : there()) {
      if (is_there_[slot] && other != slot && areNear(slot, other)) near.push_back(other);
    }
    return near;
  }

  Balls listed(Slot slot) const {
    Balls list(lists_.of(slot), lists_.of(slot) + lists_.count(slot));
    std::sort(list.begin(), list.end());
    return list;
  }

  void expectRightLists() {
    for (Slot slot = 0; slot < kBalls; ++slot) {
      ASSERT_EQ(listed(slot), expected(slot)) << "of " << slot;
      shortest_ = std::min(shortest_, lists_.count(slot));
      longest_ = std::max(longest_, lists_.count(slot));
    }
  }

  RandomNumbers random_{1};
  std::vector<CellCoordinates> homes_;
  std::vector<bool> is_there_;
  NeighbourLists lists_;
  std::size_t shortest_ = kBalls;
  std::size_t longest_ = 0;
};

TEST_F(NeighbourListsTest, NameThoseInReachWhateverChanges) {
  for (int change = 0; change < 2000; ++change) {
    const auto slot = static_cast<Slot>(random_.index(kBalls));
    is_there_[slot] && random_.chance(0.3) ? go(slot) : come(slot);
    if (change % 50 == 0) giveOtherSlots();
    ASSERT_NO_FATAL_FAILURE(expectRightLists()) << "change " << change;
  }
  EXPECT_LT(shortest_, 5U);
  EXPECT_GT(longest_, 40U) << "longer than a cache line and than a row at first";
}

TEST_F(NeighbourListsTest, AreThoseOfTheFirstFillToo) {
  std::vector<Balls> renewed;
  for (Slot slot = 0; slot < kBalls; ++slot) renewed.push_back(listed(slot));
  for (Slot slot = 0; slot < kBalls; ++slot) lists_.fill(slot, there().data(), there().size());
  lists_.makeRoom();
  for (Slot slot = 0; slot < kBalls; ++slot) EXPECT_EQ(listed(slot), renewed[slot]);
}

// Searches load what follows a list up to a whole step: slots that there are.
TEST_F(NeighbourListsTest, AreFollowedBySlots) {
  std::size_t balls = kBalls;
  for (; balls > 10; balls -= 10) {
    for (int change = 0; change < 100; ++change) come(static_cast<Slot>(random_.index(balls)));
    for (Slot slot = 0; slot < balls; ++slot) {
      const std::size_t steps = (lists_.count(slot) + kSearchStep - 1) / kSearchStep;
      for (std::size_t i = 0; i < steps * kSearchStep; ++i) {
        ASSERT_LT(lists_.of(slot)[i], balls) << "of " << balls;
      }
    }
    // Those with the lowest slots leave, and the others move up.
    std::vector<Slot> to(balls);
    for (Slot slot = 0; slot < balls; ++slot) {
      if (slot < 10) go(slot);
      to[slot] = static_cast<Slot>((slot + balls - 10) % balls);
    }
    std::rotate(homes_.begin(), homes_.begin() + 10, homes_.begin() + std::ptrdiff_t(balls));
    std::rotate(is_there_.begin(), is_there_.begin() + 10,
                is_there_.begin() + std::ptrdiff_t(balls));
    lists_.renumber(to, balls - 10);
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
