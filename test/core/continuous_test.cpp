// Method continuous: no bit depends on frames or threads, no impact is missed, nothing is allocated
// once it runs. That its impacts are the right ones is for the tests of all exact methods.
#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "ball_sim/observables.hpp"
#include "continuous/exact_sum.hpp"
#include "support/allocation_counter.hpp"
#include "support/fills.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

constexpr const char* kMethod = "continuous";

MethodSettings withThreads(unsigned threads) {
  MethodSettings settings;
  settings.threads = threads;
  return settings;
}

/// Balls of 1 kg in a closed box.
TestScene gas(std::size_t count, double largest_radius = 0.05, double packing_fraction = 0.1) {
  Scene scene;
  scene.fill = {fillOf(count, {0.05, largest_radius}, packing_fraction)};
  return placed(scene);
}

std::uint64_t hashOf(const Trial& run) { return stateHash(run.states()); }

void expectSameCollisions(const Trial& a, const Trial& b) {
  ASSERT_EQ(a.collisions().size(), b.collisions().size());
  for (std::size_t i = 0; i < a.collisions().size(); ++i) {
    const Collision& one = a.collisions()[i];
    const Collision& other = b.collisions()[i];
    ASSERT_EQ(one.time, other.time) << i;
    ASSERT_EQ(one.a, other.a) << i;
    ASSERT_EQ(one.b, other.b) << i;
    ASSERT_EQ(one.normal, other.normal) << i;
    ASSERT_EQ(one.impulse, other.impulse) << i;
  }
}

TEST(Continuous, sameBitsForAnyNumberOfThreads) {
  const TestScene scene = gas(15000);  // enough for the threads to be woken, for plans too
  Trial alone(kMethod, scene, withThreads(1));
  alone.advanceTo(0.2);
  ASSERT_GT(alone.collisions().size(), 10000u);
  for (const unsigned threads : {2u, 3u}) {
    Trial together(kMethod, scene, withThreads(threads));
    together.advanceTo(0.2);
    EXPECT_EQ(hashOf(together), hashOf(alone)) << threads;
    EXPECT_EQ(together.method().statistics().virial, alone.method().statistics().virial);
    expectSameCollisions(together, alone);
  }
}

constexpr std::size_t kPlannedBalls = 5000;  // enough for impacts to be planned

/// Gases in which impacts of a slice often have to do with each other, and in which they hold what
/// a plan has to know: walls, images, falls, histories, sizes.
std::vector<std::pair<const char*, TestScene>> plannedScenes() {
  std::vector<std::pair<const char*, TestScene>> scenes;
  scenes.emplace_back("dilute", gas(kPlannedBalls));
  scenes.emplace_back("dense", gas(kPlannedBalls, 0.05, 0.4));
  scenes.emplace_back("sizes", gas(kPlannedBalls, 0.2));
  scenes.emplace_back("periodic", gas(kPlannedBalls, 0.05, 0.2));
  scenes.back().second.surroundings.periodic = true;
  scenes.emplace_back("falling", gas(kPlannedBalls, 0.05, 0.2));
  scenes.back().second.surroundings.gravity = Vector3(1, 0, -9);
  scenes.back().second.surroundings.restitution = 0.9;
  for (std::size_t i = 0; i < kPlannedBalls; i += 50) {
    Ball& ball = scenes.back().second.balls[i];
    ball.velocity = Vector3::Zero();
    ball.mass = kFixed;
  }
  return scenes;
}

// A slice with more impacts than may be taken is not planned: what is planned against what is taken
// in turn. With some more allowed, plans are interrupted.
TEST(Continuous, sameBitsWhetherPlannedOrInTurn) {
  for (const auto& [name, scene] : plannedScenes()) {
    SCOPED_TRACE(name);
    const Time end = Time::fromSeconds(0.08);
    Trial in_turn(kMethod, scene);
    while (!in_turn.method().advanceTo(end, 1)) {
    }
    ASSERT_GT(in_turn.collisions().size(), scene.balls.size() / 4);
    Trial planned(kMethod, scene);
    planned.method().advanceTo(end);
    Trial interrupted(kMethod, scene);
    RandomNumbers random(10);
    while (!interrupted.method().advanceTo(end, 30 + random.index(30))) {
      // As far as it has come all is as it should be.
      EXPECT_LT(interrupted.method().statistics().deepest_overlap, 1e-13);
    }
    for (const Trial* other : {&planned, &interrupted}) {
      EXPECT_EQ(hashOf(*other), hashOf(in_turn));
      expectSameCollisions(*other, in_turn);
      EXPECT_EQ(other->method().statistics().events, in_turn.method().statistics().events);
    }
    if (HasFailure()) return;
  }
}

// What is read when plans are interrupted is the state of that instant.
TEST(Continuous, isWhereItSaysWhenInterrupted) {
  const TestScene scene = gas(kPlannedBalls, 0.05, 0.3);
  Trial interrupted(kMethod, scene);
  Trial straight(kMethod, scene);
  RandomNumbers random(11);
  const Time end = Time::fromSeconds(0.01);
  int stops = 0;
  while (!interrupted.method().advanceTo(end, 20 + random.index(30))) {
    straight.method().advanceTo(interrupted.method().now());
    ASSERT_EQ(hashOf(interrupted), hashOf(straight)) << stops;
    ++stops;
  }
  EXPECT_GT(stops, 20);
}

// Eleven impacts in one slice: ten far from each other, which are planned, and the first of three
// in a row of balls, which are taken in turn. With twelve allowed the last one may no longer
// happen, when the plans come true before it; so it is one of these that has happened last.
TEST(Continuous, isAtItsLastPlannedImpactWhenInterrupted) {
  TestScene scene;
  const double radius = 0.5;
  const auto add = [&](double x, double y, double speed) {
    scene.balls.push_back({Vector3(x, y, 0), Vector3(speed, 0, 0), radius, 1});
  };
  for (int pair = 0; pair < 10; ++pair) {
    add(0, 10 * pair, 1);
    add(1.05 + 0.001 * pair, 10 * pair, 0);  // after 0.05 s and more
  }
  add(0, -10, 1);
  for (const double x : {1.01, 2.02, 3.1}) add(x, -10, 0);  // after 0.01, 0.02 and 0.1 s
  while (scene.balls.size() < kPlannedBalls) add(1e4, 2.0 * double(scene.balls.size()), 0);
  Trial run(kMethod, scene);
  ASSERT_FALSE(run.method().advanceTo(Time::fromSeconds(0.2), 12));
  ASSERT_EQ(run.collisions().size(), 12u);
  EXPECT_EQ(run.method().now(), run.collisions().back().time);
  EXPECT_NEAR(run.method().now() - Time(), 0.059, 1e-15);
}

/// Clusters whose balls meet at once, each cluster at its own time: three in a row, or six around
/// one. Far from them pairs that meet one by one, so that slices are worth planning.
class Clusters {
 public:
  Clusters(std::size_t rows, std::size_t flowers, std::size_t pairs) : random_(12) {
    for (std::size_t i = 0; i < rows; ++i) addRow(random_.uniform(0, 1));
    for (std::size_t i = 0; i < flowers; ++i) addFlower(random_.uniform(0, 1));
    in_clusters_ = static_cast<BallId>(scene_.balls.size());
    for (std::size_t i = 0; i < pairs; ++i) addPair(1 + random_.uniform(0, 1));
  }

  const TestScene& scene() const { return scene_; }

  /// Between the first two impacts of each cluster, s.
  std::vector<double> dates(const char* method) const {
    Trial run(method, scene_);
    run.advanceTo(1.1);
    std::vector<double> dates;
    const Collision* last = nullptr;
    for (const Collision& collision : run.collisions()) {
      if (collision.a >= in_clusters_) continue;
      const double date = collision.time - Time();
      if (dates.empty() || date > dates.back() + 1e-9) {
        dates.push_back(date);
      } else if (last->time - Time() == dates.back()) {
        dates.back() += (collision.time - last->time) / 2;
      }
      last = &collision;
    }
    return dates;
  }

 private:
  // Moves on to another place, whose coordinates round the times of impact unlike.
  Vector3 nextPlace() {
    const auto place = static_cast<double>(places_++);
    return {random_.uniform(-10, 10), 10 * std::fmod(place, 40), 10 * std::floor(place / 40)};
  }
  void add(const Vector3& place, const Vector3& velocity, double mass) {
    scene_.balls.push_back({place, velocity, 0.5, mass});
  }
  void addRow(double time) {
    const Vector3 middle = nextPlace();
    for (const int side : {-1, 0, 1}) {
      const Vector3 out(side, 0, 0);
      add(middle + (1 + time) * out, -out, side == 0 ? 2 : 1);
    }
  }
  void addFlower(double time) {
    const Vector3 middle = nextPlace();
    add(middle, Vector3::Zero(), 1);
    for (int i = 0; i < 6; ++i) {
      const double angle = i * std::acos(-1.0) / 3;
      const Vector3 out(std::cos(angle), std::sin(angle), 0);
      add(middle + (1 + time) * out, -out, random_.uniform(0.5, 2));
    }
  }
  void addPair(double distance) {
    const Vector3 place = nextPlace();
    add(place, Vector3::UnitX(), 1);
    add(place + distance * Vector3::UnitX(), Vector3::Zero(), 1);
  }

  RandomNumbers random_;
  std::size_t places_ = 0;
  BallId in_clusters_ = 0;
  TestScene scene_;
};

/// Of a run that stops at some dates, with so many impacts allowed at once.
std::uint64_t ambiguousImpacts(const char* method, const TestScene& scene,
                               std::vector<double> dates, std::uint64_t at_once = 100000) {
  dates.push_back(1.1);
  Trial run(method, scene);
  for (const double date : dates) {
    while (!run.method().advanceTo(Time::fromSeconds(date), at_once)) {
    }
  }
  return run.method().statistics().ambiguous_impacts;
}

// A slice ends where the caller's frame does, here between impacts of one instant.
TEST(Continuous, seesImpactsOfOneInstantInTwoSlices) {
  for (const auto& [rows, flowers] : {std::pair{100, 0}, std::pair{0, 100}}) {
    SCOPED_TRACE(rows > 0 ? "rows" : "flowers");
    const Clusters clusters(rows, flowers, kPlannedBalls / 2);
    const TestScene& scene = clusters.scene();
    const std::vector<double> dates = clusters.dates(kMethod);
    ASSERT_GE(dates.size(), 100u);
    // Of a flower another order to rounding gives other impacts, so that other methods count
    // others; of a row none.
    const std::uint64_t in_turn = ambiguousImpacts(kMethod, scene, {}, 1);
    if (rows > 0) {
      EXPECT_EQ(in_turn, ambiguousImpacts("event_driven", scene, {}));
    }
    ASSERT_GE(in_turn, 100u);
    EXPECT_EQ(ambiguousImpacts(kMethod, scene, {}), in_turn);
    EXPECT_EQ(ambiguousImpacts(kMethod, scene, dates), in_turn);
  }
}

TEST(Continuous, sumsExactly) {
  ExactSum sum;
  EXPECT_EQ(sum.value(), 0);
  const double large = 0x1p53;
  for (const double term : {1.0, large, 1.0, 0.25, 0.75, 0x1p-1074, 1.0}) sum.add(term);
  EXPECT_EQ(sum.value(), large + 4);  // one by one it would be `large`, where 1 is half an ulp
  ExactSum same;
  for (const double term : {0x1p-1074, 0.25, 1.0, 1.0, 1.0, large, 0.75}) same.add(term);
  EXPECT_EQ(same.value(), sum.value());
  ExactSum small;
  for (int i = 0; i < 3; ++i) small.add(0x1p-1074);
  EXPECT_EQ(small.value(), 3 * 0x1p-1074);
  ExactSum huge;
  for (int i = 0; i < 4; ++i) huge.add(0x1.8p1020);
  EXPECT_EQ(huge.value(), 0x1.8p1022);
  // Whole multiples of 2^-20 below 2^53 of them: integers are the oracle.
  RandomNumbers random(13);
  ExactSum many;
  std::uint64_t expected = 0;
  for (int i = 0; i < 10000; ++i) {
    const auto whole = static_cast<std::uint64_t>(random.uniform(0, 1e11));
    expected += whole;
    many.add(std::ldexp(static_cast<double>(whole), -20));
  }
  EXPECT_EQ(many.value(), std::ldexp(static_cast<double>(expected), -20));
}

// Of every kind of scene: steps of any length, and stops at any number of impacts.
TEST(Continuous, sameBitsForAnyFrames) {
  for (const SceneKind& kind : sceneKinds()) {
    SCOPED_TRACE(kind.name);
    const TestScene scene = randomScene(kind, 5);
    const double end = kind.simulated_time;
    Trial whole(kMethod, scene);
    const bool reached = whole.method().advanceTo(Time::fromSeconds(end), 20000);
    if (!reached) continue;  // a ball hums on another
    RandomNumbers random(7);
    for (const double frame : {1.0 / 60, 1.0 / 7, 1e-4, 0.0}) {
      Trial stepped(kMethod, scene);
      for (double t = 0; t < end;) {
        t = std::min(end, t + (frame > 0 ? frame * end : random.uniform(0, 0.1) * end));
        while (!stepped.method().advanceTo(Time::fromSeconds(t), random.index(5))) {
        }
      }
      EXPECT_EQ(hashOf(stepped), hashOf(whole)) << frame;
      EXPECT_EQ(stepped.method().statistics().virial, whole.method().statistics().virial) << frame;
      expectSameCollisions(stepped, whole);
      if (HasFailure()) return;
    }
  }
}

// A ball that is taken out ends the frame at that instant, and nothing else if nobody could have
// met it: here specks in a corner that no ball fits into. So frames begin anywhere, and slots
// change.
TEST(Continuous, sameBitsWhereverFramesBegin) {
  int kinds = 0;
  for (const SceneKind& kind : sceneKinds()) {
    if (kind.boundary != Boundary::closed || kind.offset > 0) continue;
    SCOPED_TRACE(kind.name);
    TestScene scene = randomScene(kind, 6);
    const auto first_speck = static_cast<BallId>(scene.balls.size());
    constexpr int kSpecks = 40;
    for (int i = 0; i < kSpecks; ++i) {
      Vector3 place = Vector3::Constant(1e-7 * (i + 1));
      if (kind.planar) place.z() = 0;
      scene.balls.push_back({place, Vector3::Zero(), 1e-8, kFixed});
    }
    Trial whole(kMethod, scene);
    if (!whole.method().advanceTo(Time::fromSeconds(kind.simulated_time), 20000)) continue;
    Trial broken(kMethod, scene);
    RandomNumbers random(8);
    double t = 0;
    for (int i = 0; i < kSpecks; ++i) {
      t += random.uniform(0, 2.0 / kSpecks) * (kind.simulated_time - t) / 2;
      broken.advanceTo(t);
      broken.method().remove(first_speck + static_cast<BallId>(i));
    }
    broken.advanceTo(kind.simulated_time);
    for (BallId id = 0; id < first_speck; ++id) {
      ASSERT_EQ(broken.position(id), whole.position(id)) << id;
      ASSERT_EQ(broken.velocity(id), whole.velocity(id)) << id;
    }
    expectSameCollisions(broken, whole);
    if (HasFailure()) return;
    ++kinds;
  }
  EXPECT_GT(kinds, 10);
}

// Inside one long frame and in many: the fold of a straight line, in closed form.
TEST(Continuous, aFastBulletLosesNeitherTimeNorSpeed) {
  const double radius = 0.01;
  const double speed = 60;  // 100 radii in 1/60 s
  TestScene scene;
  scene.surroundings.box.min = Vector3::Zero();
  scene.surroundings.box.max = Vector3::Constant(1);
  const Vector3 start(0.3, 0.4, 0.6);
  const Vector3 velocity = speed * Vector3(2, 3, 6) / 7;
  scene.balls = {{start, velocity, radius, 1}};
  for (const double frame : {1.0 / 60, 1.0, 100.0}) {
    Trial run(kMethod, scene);
    for (int k = 1; k * frame <= 100; ++k) run.advanceTo(k * frame);
    run.advanceTo(100);
    for (int axis = 0; axis < 3; ++axis) {
      const long double room = 1 - 2 * static_cast<long double>(radius);
      const long double way = start[axis] - static_cast<long double>(radius) +
                              100 * static_cast<long double>(velocity[axis]);
      long double fold = std::fmod(way, 2 * room);
      if (fold > room) fold = 2 * room - fold;
      EXPECT_NEAR(run.position(0)[axis], double(fold + static_cast<long double>(radius)), 1e-10);
    }
    // Impacts with walls turn signs: not a bit of the speed is lost.
    EXPECT_NEAR(run.velocity(0).norm() / speed, 1, 1e-14);
  }
}

// Reference case 1: what a method that looks for overlap at the end of a frame misses.
TEST(Continuous, missesNoneOfTheChordsThatStepsMiss) {
  RandomNumbers random(9);
  const double radius = 0.5;
  int hits = 0;
  for (int i = 0; i < 3000; ++i) {
    TestScene scene;
    const double offset = random.uniform(0, 1.2);  // of the sum of radii, 1 m
    const double frame = 0.2;                      // m of way at 1 m/s: a chord may be shorter
    scene.balls = {{Vector3(-2 + random.uniform(0, frame), offset, 0), Vector3(1, 0, 0), radius, 1},
                   {Vector3::Zero(), Vector3::Zero(), radius, 1}};
    Trial run(kMethod, scene);
    for (double t = frame; t < 4; t += frame) run.advanceTo(t);
    ASSERT_EQ(run.collisions().size(), offset < 1 ? 1u : 0u) << offset;
    hits += offset < 1 ? 1 : 0;
  }
  EXPECT_GT(hits, 2000);
}

TEST(Continuous, allocatesNothingOnceRunning) {
  for (const unsigned threads : {1u, 2u}) {
    const TestScene scene = gas(kPlannedBalls);
    Trial run(kMethod, scene, withThreads(threads));
    run.method().setCollisionLog(nullptr);
    run.advanceTo(3);
    BallStates states = run.states();
    const std::size_t bytes = run.method().statistics().bytes;
    const long before = allocations;
    for (double t = 3; t < 4; t += 1.0 / 60) {
      run.method().advanceTo(Time::fromSeconds(t));
      run.method().read(states);
    }
    EXPECT_EQ(allocations - before, 0) << threads;
    EXPECT_EQ(run.method().statistics().bytes, bytes);
  }
}

// In a closed box, whose walls take 16 bytes a ball.
TEST(Continuous, keepsToAQuarterOfAKilobyteABall) {
  for (const auto& [packing_fraction, most] :
       {std::pair{0.05, 220}, std::pair{0.1, 230}, std::pair{0.2, 240}, std::pair{0.45, 300}}) {
    Trial run(kMethod, gas(kPlannedBalls, 0.05, packing_fraction));
    run.log().capacity = 0;
    for (double t = 0; t < 0.6; t += 1.0 / 60) run.advanceTo(t);  // the first frames take more
    const double bytes = double(run.method().statistics().bytes) / kPlannedBalls;
    EXPECT_LE(bytes, most) << "packing fraction " << packing_fraction;
    EXPECT_GE(bytes, 2 * 64) << "two cache lines are each ball's own";
  }
}

// A ball that is hit may become faster than any in the frame: the frame is then cut short.
TEST(Continuous, aSlowCrowdIsHitByABullet) {
  TestScene scene = gas(200, 0.2);
  for (Ball& ball : scene.balls) ball.velocity *= 1e-3;
  scene.balls[7].velocity = Vector3(100, 30, -20);
  Trial whole(kMethod, scene);
  whole.advanceTo(0.5);
  ASSERT_GT(whole.collisions().size(), 500u);
  EXPECT_LT(whole.method().statistics().deepest_overlap, 1e-13);
  EXPECT_NEAR(double(kineticEnergyOf(scene, whole.states()) /
                     kineticEnergyOf(scene, Trial(kMethod, scene).states())),
              1, 1e-13);  // some thousand roundings of 1e-16
}

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
