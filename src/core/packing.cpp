// Finds places for balls that overlap nothing.
#include "packing.hpp"

#include <algorithm>
#include <numeric>
#include <optional>
#include <string>

#include "ball_sim/ball_check.hpp"
#include "ball_sim/fill.hpp"
#include "ball_sim/overlap_index.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim {
namespace {

// Enough for a ball to find the last per mille of the room.
constexpr int kTriesPerBall = 5000;

// Indices of the balls, largest first.
std::vector<std::size_t> bySize(const std::vector<Ball>& balls) {
  std::vector<std::size_t> order(balls.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&balls](std::size_t a, std::size_t b) {
    return balls[a].radius > balls[b].radius;
  });
  return order;
}

// Where centres of balls of `radius` may lie, as far as the box goes; empty when min > max.
Box centresWithin(const Surroundings& surroundings, double radius) {
  Box room = surroundings.box;
  for (int axis = 0; !surroundings.periodic && axis < (surroundings.planar() ? 2 : 3); ++axis) {
    room.min[axis] += radius;
    room.max[axis] -= radius;
  }
  return room;
}

Vector3 drawPlace(const Box& room, RandomSource& random) {
  Vector3 place = room.min;
  for (int axis = 0; axis < 3; ++axis) {
    if (room.max[axis] > room.min[axis]) {
      place[axis] = random.uniform(room.min[axis], room.max[axis]);
    }
  }
  return place;
}

OverlapIndex indexOf(const std::vector<Ball>& balls, const Surroundings& surroundings) {
  OverlapIndex index(surroundings);
  for (const std::size_t i : bySize(balls)) index.insert(i, balls[i].position, balls[i].radius);
  return index;
}

// Random sequential addition: each ball in turn, largest first, goes to the first free place drawn.
// @return how many found one
std::size_t addSequentially(std::vector<Ball>& balls, const Surroundings& surroundings,
                            const std::vector<Ball>& present, RandomSource& random) {
  OverlapIndex index = indexOf(present, surroundings);
  std::size_t placed = 0;
  for (const std::size_t i : bySize(balls)) {
    Ball& ball = balls[i];
    const Box room = centresWithin(surroundings, ball.radius);
    int tries = 0;
    do {
      if (++tries > kTriesPerBall) return placed;
      ball.position = drawPlace(room, random);
    } while (checkPlace(ball.position, ball.radius, surroundings) ||
             index.overlapsAny(ball.position, ball.radius));
    index.insert(i, ball.position, ball.radius);
    ++placed;
  }
  return placed;
}

}  // namespace

void placeBalls(std::vector<Ball>& balls, const Surroundings& surroundings,
                const std::vector<Ball>& present, RandomSource& random) {
  const std::size_t placed = addSequentially(balls, surroundings, present, random);
  if (placed == balls.size()) return;
  throw PackingError("only " + std::to_string(placed) + " of " + std::to_string(balls.size()) +
                     " balls found a place without overlap: fewer or smaller balls, or a larger "
                     "box, would fit");
}

}  // namespace ball_sim
