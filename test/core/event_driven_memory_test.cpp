// Method event_driven: no allocation once running, and how much memory a ball takes.
#include <gtest/gtest.h>

#include "event_driven/grid_layout.hpp"
#include "support/allocation_counter.hpp"
#include "support/fills.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

// More than a power of two: what doubling has left over must be given back.
constexpr std::size_t kBalls = 1100;

/// So many that they are sorted in memory as they mix.
constexpr std::size_t kManyBalls = kCachedBalls + 100;

/// Equal balls in a periodic box.
TestScene fluid(double packing_fraction, std::size_t balls = kBalls) {
  return placed(periodicScene(fillOf(balls, {0.5, 0.5}, packing_fraction)));
}

/// The fluid's balls on a face-centred cubic lattice, four to each of edge^3 cells.
TestScene crystal(double packing_fraction, int edge) {
  TestScene scene = fluid(packing_fraction, static_cast<std::size_t>(4 * edge * edge * edge));
  const Vector3 cell = (scene.surroundings.box.max - scene.surroundings.box.min) / edge;
  for (std::size_t i = 0; i < scene.balls.size(); ++i) {
    const int at = static_cast<int>(i / 4), site = static_cast<int>(i % 4);
    const Vector3 corner(at % edge, at / edge % edge, at / edge / edge);
    const Vector3 in_cell(site % 2 * 0.5, (site + 1) / 2 % 2 * 0.5, site / 2 * 0.5);
    scene.balls[i].position = scene.surroundings.box.min + (corner + in_cell).cwiseProduct(cell);
  }
  return scene;
}

/// Balls whose sizes differ tenfold, on several levels of cells.
TestScene mixture(std::size_t balls) {
  return placed(periodicScene(fillOf(balls, {0.1, 1}, 0.05)));
}

/// Balls that fall and bounce in a closed box.
TestScene falling(std::size_t balls = kBalls) {
  TestScene scene = fluid(0.05, balls);
  Surroundings& around = scene.surroundings;
  around.periodic = false;
  around.box.min -= Vector3::Constant(0.5);  // no ball reaches out of it
  around.box.max += Vector3::Constant(0.5);
  around.gravity = Vector3(0, 0, -0.05);
  return scene;
}

/// Nothing from the first moment on, in which space is cut for the balls.
void expectNoAllocation(const TestScene& scene, double end) {
  Trial run("event_driven", scene);
  run.log().capacity = 0;
  run.advanceTo(0);
  BallStates states = run.states();
  const Statistics before = run.method().statistics();
  const long allocated = allocations;
  run.advanceTo(end);
  run.method().read(states);
  EXPECT_EQ(allocations - allocated, 0);
  const Statistics after = run.method().statistics();
  EXPECT_EQ(after.bytes, before.bytes);
  EXPECT_GT(after.ball_collisions, before.ball_collisions + 10 * kBalls);
}

TEST(EventDrivenMemory, NothingIsAllocatedOnceDiluteBallsFly) {
  expectNoAllocation(fluid(0.05), 50);
}

TEST(EventDrivenMemory, NothingIsAllocatedOnceDenseBallsFly) {
  expectNoAllocation(fluid(0.49), 15);
}

// On the lattice every ball has as many neighbours as the next, later some have more.
TEST(EventDrivenMemory, NothingIsAllocatedWhenACrystalMelts) {
  expectNoAllocation(crystal(0.49, 7), 15);
}

TEST(EventDrivenMemory, NothingIsAllocatedOnceBallsFall) { expectNoAllocation(falling(), 50); }

/// Makes all balls faster, so that the calendar has to be tuned.
void speedUp(Method& method, const BallStates& states, double factor) {
  for (const BallId id : states.ids) {
    method.setVelocity(id, factor * method.ball(id).velocity);
  }
}

/// Takes some balls out, and puts the same in again under new names.
void rename(Method& method, BallStates& states, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const Ball ball = method.ball(states.ids[i]);
    method.remove(states.ids[i]);
    method.insert(states.ids.back() + 1 + static_cast<BallId>(i), ball);
  }
  method.read(states);
}

/// @param sorting  s, about what it takes for balls to be sorted again at their first speeds
void expectNoAllocationInSorting(const TestScene& scene, double sorting) {
  constexpr std::size_t kRenamed = 100;
  Trial run("event_driven", scene);
  Method& method = run.method();
  run.log().capacity = 0;
  double end = 1.5 * sorting;
  run.advanceTo(end);
  BallStates states = run.states();
  const std::size_t bytes = method.statistics().bytes;
  const long allocated = allocations;
  for (const double factor : {4.0, 0.25}) {
    speedUp(method, states, factor);
    rename(method, states, kRenamed);
    run.advanceTo(end += 1.5 * (factor > 1 ? sorting / factor : sorting));
  }
  EXPECT_EQ(allocations - allocated, 0);
  EXPECT_EQ(method.statistics().bytes, bytes);
  EXPECT_LE(double(bytes) / double(scene.balls.size()), 250);
}

TEST(EventDrivenMemory, NothingIsAllocatedWhenManyDiluteBallsAreSorted) {
  expectNoAllocationInSorting(fluid(0.05, kManyBalls), 22);
}

TEST(EventDrivenMemory, NothingIsAllocatedWhenManyDenseBallsAreSorted) {
  expectNoAllocationInSorting(fluid(0.35, kManyBalls), 6.5);
}

TEST(EventDrivenMemory, NothingIsAllocatedWhenManyUnequalBallsAreSorted) {
  expectNoAllocationInSorting(mixture(kManyBalls), 22);
}

TEST(EventDrivenMemory, NothingIsAllocatedWhenManyFallingBallsAreSorted) {
  expectNoAllocationInSorting(falling(kManyBalls), 22);
}

// A ball that is too large for the cells makes space be cut anew before the slot of the one that is
// gone is used again.
TEST(EventDrivenMemory, NothingIsLeftOfABallThatRestedAndIsGone) {
  Trial run("event_driven", {floorUnderGravity(1, 0.5), {}});
  Method& method = run.method();
  run.log().capacity = 0;
  Ball ball;
  ball.mass = 1;
  ball.radius = 0.5;
  std::size_t bytes = 0;
  for (BallId id = 0; id < 200; ++id) {
    ball.radius *= 1.01;
    ball.position.z() = ball.radius;
    method.insert(id, ball);
    if (id > 0) method.remove(id - 1);
    run.advanceTo(id + 1);
    EXPECT_EQ(method.ball(id).position.z(), ball.radius) << "it rests";
    if (id == 10) bytes = method.statistics().bytes;
  }
  EXPECT_EQ(method.statistics().bytes, bytes);
}

TEST(EventDrivenMemory, ABallTakesAQuarterOfAKilobyte) {
  for (const double packing_fraction : {0.05, 0.2, 0.49}) {
    Trial run("event_driven", fluid(packing_fraction));
    run.log().capacity = 0;
    run.advanceTo(10);
    const double bytes = double(run.method().statistics().bytes) / double(kBalls);
    EXPECT_LE(bytes, 250) << "packing fraction " << packing_fraction;
    EXPECT_GE(bytes, 2 * 64) << "two cache lines are each ball's own";
    RecordProperty("bytes_per_ball", std::to_string(bytes));
  }
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
