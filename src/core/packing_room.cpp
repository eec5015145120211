// Where centres of balls may lie.
#include "packing_room.hpp"

#include <algorithm>
#include <numeric>

namespace ball_sim::core {

Box centresWithin(const Surroundings& surroundings, double radius) {
  Box room = surroundings.box;
  for (int axis = 0; !surroundings.periodic && axis < axesOf(surroundings); ++axis) {
    room.min[axis] += radius;
    room.max[axis] -= radius;
  }
  return room;
}

std::vector<std::size_t> bySize(const std::vector<Ball>& balls) {
  std::vector<std::size_t> order(balls.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&balls](std::size_t a, std::size_t b) {
    return balls[a].radius > balls[b].radius;
  });
  return order;
}

OverlapIndex indexOf(const std::vector<Ball>& balls, const Surroundings& surroundings,
                     std::size_t first) {
  OverlapIndex index(surroundings);
  for (const std::size_t i : bySize(balls)) {
    index.insert(first + i, balls[i].position, balls[i].radius);
  }
  return index;
}

}  // namespace ball_sim::core
