// Energy, momentum and hash of states against sums done by hand.
#include "ball_sim/observables.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace ball_sim::core {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

BallStates threeBalls() {
  BallStates states;
  states.ids = {0, 1, 5};
  states.positions = {{1, 2, 3}, {0, 0, -1}, {4, 4, 4}};
  states.velocities = {{3, 0, 4}, {0, -2, 0}, {0, 0, 0}};
  return states;
}

const std::vector<double> kMasses = {2, 3, kInf};  // kg

TEST(Observables, SumsOverFreeBalls) {
  EXPECT_EQ(kineticEnergy(threeBalls(), kMasses), 2 * 25 / 2.0 + 3 * 4 / 2.0);
  EXPECT_EQ(potentialEnergy(threeBalls(), kMasses, {0, 0, -10}), 2 * 10 * 3 - 3 * 10 * 1);
  EXPECT_EQ(momentum(threeBalls(), kMasses), Vector3(6, -6, 8));
  EXPECT_EQ(kineticEnergy({}, {}), 0);
}

TEST(Observables, SumsLoseNothing) {
  // In plain double 1 is lost beside 1e16.
  BallStates states = threeBalls();
  states.velocities = {{1e16, 0, 0}, {1, 0, 0}, {-1e16, 0, 0}};
  EXPECT_EQ(momentum(states, {1, 1, 1}).x(), 1);
}

TEST(Observables, HashTellsStatesApart) {
  const std::uint64_t hash = stateHash(threeBalls());
  EXPECT_EQ(stateHash(threeBalls()), hash);
  BallStates moved = threeBalls();
  moved.positions[1].z() = std::nextafter(-1.0, 0.0);
  EXPECT_NE(stateHash(moved), hash);
  BallStates renamed = threeBalls();
  renamed.ids[2] = 6;
  EXPECT_NE(stateHash(renamed), hash);
  BallStates turned = threeBalls();
  turned.velocities[2].x() = -0.0;
  EXPECT_NE(stateHash(turned), hash);
}

TEST(Observables, HashIsFnv1a) {
  // Nothing hashed: the published offset basis.
  EXPECT_EQ(stateHash({}), 0xcbf29ce484222325u);
  // One ball of id 0 at rest at the origin: 56 zero bytes, each a multiplication by the prime.
  BallStates one;
  one.ids = {0};
  one.positions = {Vector3::Zero()};
  one.velocities = {Vector3::Zero()};
  std::uint64_t expected = 0xcbf29ce484222325u;
  for (int byte = 0; byte < 56; ++byte) expected *= 0x100000001b3u;
  EXPECT_EQ(stateHash(one), expected);
}

}  // namespace
}  // namespace ball_sim::core
