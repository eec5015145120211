// Pushes overlapping balls apart until none overlap.
#include "packing_relaxation.hpp"

#include <algorithm>
#include <cmath>

#include "ball_sim/ball_check.hpp"
#include "packing_room.hpp"

namespace ball_sim::core {
namespace {

// Balls are kept this share of their radius further apart than they need be: otherwise the last
// bit of an overlap would take for ever to go.
constexpr double kMargin = 1e-3;

// Moves of a ball, all balls together: some ten seconds.
constexpr double kMostMoves = 4e6;
constexpr std::size_t kMostSweeps = 5000;

// Sweeps without any fewer overlaps after which nothing is to be hoped for.
constexpr std::size_t kPatience = 500;

// Where balls push each other from all sides, full steps overshoot.
constexpr double kStep = 0.6;

class Relaxation {
 public:
  Relaxation(std::vector<Ball>& balls, const Surroundings& surroundings,
             const std::vector<Ball>& present)
      : balls_(balls), surroundings_(surroundings), present_(present), order_(bySize(balls)) {}

  void scatter(RandomSource& random) {
    for (Ball& ball : balls_) {
      const Box room = centresWithin(surroundings_, ball.radius);
      for (int axis = 0; axis < 3; ++axis) {
        ball.position[axis] = random.uniform(room.min[axis], room.max[axis]);
      }
      moveInside(ball);
    }
  }

  // Pushes each ball by what its neighbours ask. @return how many overlap something, before
  std::size_t sweep() {
    const OverlapIndex index = indexOfAll();
    std::vector<Vector3> shifts(balls_.size());
    std::size_t overlapping_balls = 0;
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      bool overlaps =
          static_cast<bool>(checkPlace(balls_[i].position, balls_[i].radius, surroundings_));
      shifts[i] = shiftOf(i, index, overlaps);
      if (overlaps) ++overlapping_balls;
    }
    if (overlapping_balls == 0) return 0;
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      balls_[i].position += shifts[i];
      moveInside(balls_[i]);
    }
    return overlapping_balls;
  }

 private:
  const Ball& numbered(std::size_t number) const {
    return number < balls_.size() ? balls_[number] : present_[number - balls_.size()];
  }

  OverlapIndex indexOfAll() const {
    OverlapIndex index = indexOf(present_, surroundings_, balls_.size());
    for (const std::size_t i : order_) index.insert(i, balls_[i].position, balls_[i].radius);
    return index;
  }

  Vector3 shiftOf(std::size_t i, const OverlapIndex& index, bool& overlaps) {
    const Ball& ball = balls_[i];
    // Twice the margin reaches that of each neighbour of like size.
    index.findAll(ball.position, ball.radius * (1 + 2 * kMargin), found_);
    Vector3 shift = Vector3::Zero();
    for (const std::size_t number : found_) {
      if (number == i) continue;
      const Ball& other = numbered(number);
      const Vector3 between = separation(other.position, ball.position, surroundings_);
      const double reach = ball.radius + other.radius;
      if (overlapping(between, reach)) overlaps = true;
      const double distance = std::sqrt(dot(between, between));
      const double depth = reach * (1 + kMargin) - distance;
      if (depth <= 0) continue;
      // Who is placed for good does not give way.
      const double share = number < balls_.size() ? kStep : 2 * kStep;
      shift += (share * depth) * direction(between, distance, number < i);
    }
    return shift;
  }

  // Centres that coincide are parted along x, the one this way and the other that.
  static Vector3 direction(const Vector3& between, double distance, bool forward) {
    if (distance > 0) return between / distance;
    return forward ? Vector3::UnitX() : Vector3(-Vector3::UnitX());
  }

  void moveInside(Ball& ball) const {
    for (const Plane& plane : surroundings_.planes) {
      const double inside = dot(plane.normal, ball.position) - plane.offset - ball.radius;
      if (inside < 0) ball.position -= inside * plane.normal;
    }
    if (surroundings_.periodic) {
      ball.position = wrapped(ball.position, surroundings_);
    } else {
      const Box room = centresWithin(surroundings_, ball.radius);
      ball.position = ball.position.cwiseMax(room.min).cwiseMin(room.max);
    }
  }

  std::vector<Ball>& balls_;
  const Surroundings& surroundings_;
  const std::vector<Ball>& present_;
  std::vector<std::size_t> order_;
  std::vector<std::size_t> found_;
};

}  // namespace

std::size_t relax(std::vector<Ball>& balls, const Surroundings& surroundings,
                  const std::vector<Ball>& present, RandomSource& random) {
  Relaxation relaxation(balls, surroundings, present);
  relaxation.scatter(random);
  const auto count = static_cast<double>(balls.size());
  const auto sweeps = std::min(kMostSweeps, static_cast<std::size_t>(1 + kMostMoves / count));
  std::size_t fewest = balls.size();
  std::size_t patience = kPatience;
  for (std::size_t sweep = 0; sweep < sweeps && fewest > 0 && patience > 0; ++sweep, --patience) {
    const std::size_t overlapping_balls = relaxation.sweep();
    if (overlapping_balls >= fewest) continue;
    fewest = overlapping_balls;
    patience = kPatience;
  }
  return balls.size() - fewest;
}

}  // namespace ball_sim::core
