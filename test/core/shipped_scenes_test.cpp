// Every scene in config/scenes: it reads, runs, keeps what it must, and shows what it says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "ball_sim/scene_reader.hpp"
#include "ball_sim/world.hpp"

namespace ball_sim::core {
namespace {

std::string sceneFile(const std::string& name) {
  return std::string(BALL_SIM_SOURCE_DIR) + "/config/scenes/" + name + ".yaml";
}

World load(const std::string& name) { return World(readScene(sceneFile(name))); }

bool runTo(World& world, double seconds) { return world.advanceTo(Time::fromSeconds(seconds)); }

TEST(ShippedScenes, AllRunAndConserve) {
  std::vector<std::string> names;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(BALL_SIM_SOURCE_DIR) + "/config/scenes")) {
    names.push_back(entry.path().stem());
  }
  EXPECT_GE(names.size(), 8u);
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    std::ifstream file(sceneFile(name));
    std::string first_line;
    std::getline(file, first_line);
    EXPECT_EQ(first_line.substr(0, 2), "# ") << "begins with what one sees";
    World world = load(name);
    EXPECT_EQ(world.scene().name, name);
    const double before = world.kineticEnergy() + world.potentialEnergy();
    ASSERT_TRUE(runTo(world, 5));
    const double after = world.kineticEnergy() + world.potentialEnergy();
    EXPECT_GT(world.statistics().ball_collisions + world.statistics().wall_collisions, 0u);
    if (world.surroundings().restitution == 1) {
      // Up to 10^5 impacts, each rounding a share of 1e-16.
      EXPECT_NEAR(after, before, 1e-11 * before);
    } else {
      EXPECT_LT(after, before);
    }
    // Balls of centimetres and more. By steps: the way in a step of a ball that fell by 2 m.
    const bool steps = world.method().name == "discrete";
    const double fastest_way = 1e-3 * std::sqrt(2 * 9.81 * 2);  // m
    EXPECT_LT(world.statistics().deepest_overlap, steps ? fastest_way : 1e-12);
  }
}

TEST(ShippedScenes, TwoBallsPartAsComputedByHand) {
  World world = load("two_balls");
  runTo(world, 10);
  // Exact in rational numbers; the tolerance is some roundings of numbers near 10.
  const Vector3 a(2694, -7278, -6324);
  const Vector3 b(-323, 13437 / 2.0, -969);
  EXPECT_LT((world.ball(0).position - a / 343).norm(), 1e-13);
  EXPECT_LT((world.ball(1).position - b / 343).norm(), 1e-13);
}

TEST(ShippedScenes, CradlePassesTheSpeedOn) {
  World world = load("newtons_cradle");
  // 0.3 m to the row at 0.5 m/s; the last ball then has 0.375 m to the wall.
  runTo(world, 0.8);
  for (BallId id = 0; id < 4; ++id) EXPECT_LT(world.ball(id).velocity.norm(), 1e-15) << id;
  // The speed is passed on four times, rounding each time.
  EXPECT_NEAR(world.ball(4).velocity.x(), 0.5, 1e-15);
}

TEST(ShippedScenes, PiBilliardCounts314) {
  World world = load("pi_billiard");
  runTo(world, 100);
  const Statistics counted = world.statistics();
  EXPECT_EQ(counted.ball_collisions + counted.wall_collisions, 314u);
}

TEST(ShippedScenes, BreakShotTakesABallWhereTheReadmePutsIt) {
  World world = load("break_shot");
  EXPECT_EQ(world.size(), 16u);
  EXPECT_EQ(world.spawn({{0.5, 0.2, 0}, Vector3::Zero(), 0.028575, 0.17}), 16u);
  runTo(world, 2);
  BallStates states;
  world.read(states);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    EXPECT_EQ(states.positions[i].z(), 0);
    if (states.velocities[i].norm() > 0.01) ++moved;
  }
  EXPECT_GE(moved, 14u) << "the rack bursts";
}

TEST(ShippedScenes, GasesHaveTheStatedDensity) {
  EXPECT_EQ(load("gas_3d").size(), 1000u);
  EXPECT_TRUE(load("gas_2d").surroundings().planar());
}

TEST(ShippedScenes, BouncingBallComesToRestOnTime) {
  World world = load("bouncing_ball");
  const double fall = std::sqrt(2 * 1 / 9.81);
  const double rest = fall * (1 + 0.8) / (1 - 0.8);
  runTo(world, rest - 0.01);
  EXPECT_GT(world.kineticEnergy() + world.potentialEnergy(), 9.81 * 0.1);
  runTo(world, rest + 1e-6);
  EXPECT_EQ(world.ball(0).velocity, Vector3(0, 0, 0));
  EXPECT_NEAR(world.ball(0).position.z(), 0.1, 1e-14);  // on the floor, to rounding
}

TEST(ShippedScenes, CoolingGasFollowsHaff) {
  World world = load("cooling_gas");
  const double before = world.kineticEnergy();
  runTo(world, 2);
  const double tau = 6 / ((1 - 0.9 * 0.9) * 28.63);  // s; the rate by Enskog, 1000 balls in 8 m^3
  const double haff = std::pow(1 + 2 / tau, -2);
  // 1000 speeds tell a temperature to 2.6 %, and the law leaves out that the speeds of inelastic
  // spheres are not quite Maxwell's, a percent or two.
  EXPECT_NEAR(world.kineticEnergy() / before, haff, 0.1 * haff);
}

TEST(ShippedScenes, PileComesToRestAndIsStepped) {
  World world = load("pile");
  EXPECT_EQ(world.method().name, "event_driven");  // while they fall
  runTo(world, 5);
  EXPECT_EQ(world.method().name, "discrete");
  BallStates states;
  world.read(states);
  double highest = 0;  // m
  std::size_t moving = 0;
  for (std::size_t i = 0; i < states.ids.size(); ++i) {
    EXPECT_GE(states.positions[i].z(), 0.998 * world.radii()[i]) << "sinks into the floor";
    highest = std::max(highest, states.positions[i].z());
    if (states.velocities[i].norm() > 1e-3) ++moving;  // a tenth of what gravity gives in a step
  }
  EXPECT_LE(moving, 6u);  // without friction one in fifty may swing in a hollow for long
  // 300 balls of 0.0350 m at a packing fraction of 0.5 to 0.64 stand 0.23 to 0.3 m high.
  EXPECT_GT(highest, 0.2);
  EXPECT_LT(highest, 0.45);
}

TEST(ShippedScenes, MixedSizesAreMixed) {
  const World world = load("mixed_sizes");
  const auto [least, most] = std::minmax_element(world.radii().begin(), world.radii().end());
  EXPECT_GE(*most / *least, 20);
}

}  // namespace
}  // namespace ball_sim::core
