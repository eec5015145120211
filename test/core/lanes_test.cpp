// Balls in parallel lanes, each between two walls: known in closed form for ever, however many
// meet.
//
// Balls of one mass that meet head-on change their velocities with each other. Less the room that
// balls take, a lane is one of points that pass through each other and turn round at the ends
// (Tonks, "The complete equation of state of one, two and three-dimensional gases of hard elastic
// spheres", 1936). Nothing is chaotic there, so that long runs can be compared: so many balls fly
// so far that their memory is put in order on the way, twice and more.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "support/random_numbers.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

/// One lane, by the theory.
class Lane {
 public:
  /// @param length  m, from wall to wall
  Lane(double length, double radius) : length_(length), radius_(radius) {}

  /// @param share  of the free room, where the ball is without what others take, from 0 to 1
  void add(BallId id, double share, double velocity) {
    points_.push_back({share, velocity});
    ids_.push_back(id);
  }

  /// After the last add().
  void begin() {
    for (Point& point : points_) point.x *= freeLength();
    sort();
  }

  void advance(long double dt) {
    for (Point& point : points_) {
      const long double round = 2 * freeLength();
      long double x = std::fmod(point.x + point.v * dt, round);
      if (x < 0) x += round;
      if (x > freeLength()) {  // on the way back
        x = round - x;
        point.v = -point.v;
      }
      point.x = x;
    }
    sort();
  }

  /// Takes the last ball out. @return its id
  BallId removeLast() {
    const BallId id = ids_.back();
    ids_.pop_back();
    points_.pop_back();
    return id;
  }

  std::size_t size() const { return ids_.size(); }
  BallId id(std::size_t i) const { return ids_[i]; }
  double place(std::size_t i) const {
    return static_cast<double>(points_[i].x + radius_ * (1 + 2 * static_cast<long double>(i)));
  }
  double velocity(std::size_t i) const { return static_cast<double>(points_[i].v); }

 private:
  struct Point {
    long double x;  // m, without the room that balls before it take
    long double v;  // m/s
  };

  long double freeLength() const {
    return length_ - 2 * radius_ * static_cast<long double>(ids_.size());
  }

  // Balls keep their order, while points pass each other.
  void sort() {
    std::sort(points_.begin(), points_.end(),
              [](const Point& a, const Point& b) { return a.x < b.x; });
  }

  long double length_;
  long double radius_;
  std::vector<Point> points_;  // by x
  std::vector<BallId> ids_;    // likewise
};

struct Layout {
  std::string name;
  std::string method;
  int columns;    // of lanes, along y and z
  int balls;      // in a lane
  double length;  // m
  double radius;  // m
  double end;     // s
};

std::ostream& operator<<(std::ostream& out, const Layout& layout) { return out << layout.name; }

class Lanes : public testing::TestWithParam<Layout> {};

TEST_P(Lanes, StayAsTonksHasThem) {
  const Layout& layout = GetParam();
  RandomNumbers random(1);
  const int count = layout.columns * layout.columns;
  // Ids that tell nothing of places.
  std::vector<BallId> ids(static_cast<std::size_t>(count * layout.balls));
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<BallId>(i);
  for (std::size_t i = ids.size() - 1; i > 0; --i) std::swap(ids[i], ids[random.index(i + 1)]);

  TestScene scene;
  scene.surroundings.box = {Vector3::Zero(),
                            Vector3(layout.length, layout.columns, layout.columns)};
  scene.balls.resize(ids.size());
  std::vector<Lane> lanes;
  const auto placeOf = [&](std::size_t lane, double x) {
    const int k = static_cast<int>(lane);
    return Vector3(x, k % layout.columns + 0.5, k / layout.columns + 0.5);
  };
  for (int k = 0; k < count; ++k) {
    Lane lane(layout.length, layout.radius);
    for (int i = 0; i < layout.balls; ++i) {
      lane.add(ids.back(), random.uniform(0, 1), random.gaussian());
      ids.pop_back();
    }
    lane.begin();
    for (std::size_t i = 0; i < lane.size(); ++i) {
      Ball& ball = scene.balls[lane.id(i)];
      ball.position = placeOf(lanes.size(), lane.place(i));
      ball.velocity = Vector3(lane.velocity(i), 0, 0);
      ball.radius = layout.radius;
      ball.mass = 1;
    }
    lanes.push_back(lane);
  }

  Trial run(layout.method, scene);
  const double removal = 0.5;  // s
  run.advanceTo(removal);
  for (Lane& lane : lanes) lane.advance(removal);
  for (std::size_t k = 0; k < lanes.size(); k += 7) run.method().remove(lanes[k].removeLast());
  run.advanceTo(layout.end);
  for (Lane& lane : lanes) lane.advance(static_cast<long double>(layout.end) - removal);

  // Each of some hundred impacts rounds places of a few metres, and none enlarges an error.
  const double rounding = 1e-11;
  for (std::size_t k = 0; k < lanes.size(); ++k) {
    for (std::size_t i = 0; i < lanes[k].size(); ++i) {
      const Ball ball = run.method().ball(lanes[k].id(i));
      const Vector3 place = placeOf(k, lanes[k].place(i));
      ASSERT_NEAR((ball.position - place).norm(), 0, rounding) << "lane " << k << ", ball " << i;
      ASSERT_NEAR(ball.velocity.x(), lanes[k].velocity(i), rounding);
    }
  }
}

// Cells, and lists; more than 4000 balls, which is when memory is put in order, and so long that
// each has crossed a hundred cells or regions.
INSTANTIATE_TEST_SUITE_P(
    Scenes, Lanes,
    testing::Values(Layout{"event_driven_cells", "event_driven", 38, 3, 9, 0.3, 200},
                    Layout{"event_driven_lists", "event_driven", 27, 6, 8, 0.49, 60},
                    Layout{"continuous", "continuous", 38, 3, 9, 0.3, 20}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
