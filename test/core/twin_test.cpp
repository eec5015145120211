// Twins: a fast method and brute_force see the same events on random scenes of every kind, also
// while balls are inserted, removed and pushed.
//
// Hard balls are chaotic: rounding grows by a factor of free path over radius at each impact. How
// far two right methods agree is measured, not guessed: brute_force runs in long double (the
// truth) and in double, and the difference of their dates is what rounding does on this very scene.
// The method under test has to stay within a multiple of it for as long as it is small; beyond
// that horizon nothing is compared.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "support/methods_under_test.hpp"
#include "support/random_scenes.hpp"
#include "support/trial.hpp"

namespace ball_sim::core {
namespace test {
namespace {

// Other order of the same sums: other rounding of the same size, on some scenes much more of it.
constexpr double kRoundingSpread = 3e3;
// Of a scene's time: the horizon, where rounding could by now swap events.
constexpr double kHorizon = 1e-6;

// Brute force in long double is slow, and balls that lie on balls make events without end.
constexpr std::uint64_t kMostEvents = 3000;

/// A method under test, named for the test's name.
struct Candidate {
  std::string method;
  Precision precision;
};

std::ostream& operator<<(std::ostream& out, const Candidate& candidate) {
  return out << candidate.method;
}

std::vector<Candidate> candidates() {
  std::vector<Candidate> list;
  for (const std::string& name : fastMethods()) {
    list.push_back({name, Precision::double_precision});
    list.push_back({name, Precision::long_double});
  }
  return list;
}

/// Each ball's impacts in order; unlike the order of all impacts, it is not open to rounding when
/// two impacts far apart come at nearly the same time.
class Diary {
 public:
  explicit Diary(const std::vector<Collision>& log) {
    for (const Collision& collision : log) {
      pages_[collision.a].push_back({collision.b, collision.time});
      if (collision.b >= 0) {
        pages_[collision.b].push_back({static_cast<Partner>(collision.a), collision.time});
      }
    }
  }

  /// Takes the next impact of a ball out, if it is with `partner`.
  bool take(Partner ball, Partner partner, Time& time) {
    auto& page = pages_[ball];
    if (page.empty() || page.front().partner != partner) return false;
    time = page.front().time;
    page.pop_front();
    return true;
  }

  /// The next impact of a ball in words.
  std::string next(Partner ball) {
    const auto& page = pages_[ball];
    if (page.empty()) return "none";
    return "with " + std::to_string(page.front().partner) + " at " +
           std::to_string(page.front().time.seconds());
  }

  /// The earliest impact not taken out, or +infinity, s.
  double earliestLeft() const {
    double earliest = std::numeric_limits<double>::infinity();
    for (const auto& [ball, page] : pages_) {
      if (!page.empty()) earliest = std::min(earliest, page.front().time.seconds());
    }
    return earliest;
  }

 private:
  struct Entry {
    Partner partner;
    Time time;
  };
  std::map<Partner, std::deque<Entry>> pages_;
};

struct Comparison {
  std::size_t compared = 0;  // impacts below the horizon
  double envelope = 0;       // s, what rounding has done to dates so far
  bool to_the_end = false;   // the horizon was never reached
};

/// Whether an impact comes so soon after another one of the same ball with somebody else that their
/// order is up to rounding, and with it the outcome (a ball that lies on two others is hit, a
/// collapse ends).
/// @param latest  each ball's latest impact; kept up to date
bool isAmbiguous(const Collision& event, std::map<Partner, Collision>& latest, double soon) {
  bool ambiguous = false;
  for (const Partner ball : {static_cast<Partner>(event.a), event.b}) {
    if (ball < 0) continue;
    const auto before = latest.find(ball);
    if (before != latest.end() && event.time - before->second.time < soon) {
      ambiguous |= before->second.a != event.a || before->second.b != event.b;
    }
    latest[ball] = event;
  }
  return ambiguous;
}

/// Compares a log with that of the truth, as far as rounding (seen in `shadow`) lets it be known.
/// @param time_scale  s, how long the scene runs
/// @param end  s, until when the logs go
Comparison compareLogs(const std::vector<Collision>& truth, const std::vector<Collision>& shadow,
                       const std::vector<Collision>& tested, double time_scale, double end) {
  Comparison result;
  result.envelope = 1e-15 * time_scale;  // one rounding of a date
  Diary shadows(shadow);
  Diary diary(tested);
  std::map<Partner, Collision> latest;
  for (const Collision& event : truth) {
    if (isAmbiguous(event, latest, 1e-9 * time_scale)) return result;
    Time shadow_time;
    const auto a = static_cast<Partner>(event.a);
    const bool shadow_agrees = shadows.take(a, event.b, shadow_time) &&
                               (event.b < 0 || shadows.take(event.b, a, shadow_time));
    if (!shadow_agrees) return result;
    result.envelope = std::max(result.envelope, std::abs(shadow_time - event.time));
    const double tolerance = kRoundingSpread * result.envelope;
    if (tolerance > kHorizon * time_scale) return result;
    if (event.time.seconds() > end - tolerance) break;  // rounding may put it after the end
    Time time;
    if (!diary.take(a, event.b, time) || (event.b >= 0 && !diary.take(event.b, a, time))) {
      ADD_FAILURE() << "impact " << result.compared << " of ball " << event.a << " with " << event.b
                    << " at " << event.time.seconds() << " s is missing; instead ball " << event.a
                    << " has: " << diary.next(a) << ", and " << event.b
                    << " has: " << (event.b >= 0 ? diary.next(event.b) : "-");
      return result;
    }
    if (std::abs(time - event.time) > tolerance) {
      ADD_FAILURE() << "impact " << result.compared << " of ball " << event.a << " with " << event.b
                    << " at " << event.time.seconds() << " s comes " << time - event.time
                    << " s late, more than " << tolerance << " s";
      return result;
    }
    ++result.compared;
  }
  result.to_the_end = true;
  EXPECT_GE(diary.earliestLeft(), end - kRoundingSpread * result.envelope)
      << "an impact that should not be";
  return result;
}

void compareStates(const BallStates& truth, const BallStates& shadow, const BallStates& tested,
                   const SceneKind& kind) {
  ASSERT_EQ(truth.ids, tested.ids);
  const double length = 1 + kind.offset + kind.speed * kind.simulated_time;
  double place = 1e-15 * length;
  double speed = 1e-15 * kind.speed;
  for (std::size_t i = 0; i < truth.ids.size(); ++i) {
    place = std::max(place, (truth.positions[i] - shadow.positions[i]).norm());
    speed = std::max(speed, (truth.velocities[i] - shadow.velocities[i]).norm());
  }
  if (kRoundingSpread * place > kHorizon * length) return;
  for (std::size_t i = 0; i < truth.ids.size(); ++i) {
    EXPECT_LE((truth.positions[i] - tested.positions[i]).norm(), kRoundingSpread * place)
        << "ball " << truth.ids[i];
    EXPECT_LE((truth.velocities[i] - tested.velocities[i]).norm(), kRoundingSpread * speed)
        << "ball " << truth.ids[i];
  }
}

/// The log without impacts too faint to be told from rounding. Where energy is lost, impacts come
/// ever faster and fainter until a ball rests or a collapse ends; at 1e-14 m it is the last bit of
/// a place that decides which of two comes first and whether there is one more.
std::vector<Collision> withoutFaintImpacts(const std::vector<Collision>& log,
                                           const SceneKind& kind) {
  if (kind.restitution == 1) return log;
  // A bounce up to 1e-6 of a radius; a collapse down to 1e-9 of the speeds.
  const double faint =
      std::max(1e-9 * kind.speed, std::sqrt(2 * kind.gravity * 1e-6 * 2 * kind.largest_radius));
  std::vector<Collision> rest;
  for (const Collision& collision : log) {
    if (collision.approach_speed > faint) rest.push_back(collision);
  }
  return rest;
}

/// The truth, its shadow, and the method under test, in step.
class Trio {
 public:
  Trio(const Candidate& candidate, const TestScene& scene)
      : truth(kSlowTwin, scene, Precision::long_double),
        shadow(kSlowTwin, scene),
        tested(candidate.method, scene, candidate.precision) {}

  template <class Function>
  void forEach(Function f) {
    f(truth);
    f(shadow);
    f(tested);
  }

  /// Advances all, to `seconds` or as far as the truth gets with kMostEvents events in all.
  /// @return whether `seconds` was reached
  bool advanceTo(double seconds) {
    const std::uint64_t used = truth.method().statistics().events;
    const Time target = Time::fromSeconds(seconds);
    const bool reached = used < kMostEvents && truth.method().advanceTo(target, kMostEvents - used);
    const double date = reached ? seconds : truth.method().now().seconds();
    shadow.advanceTo(date, 100 * kMostEvents);
    tested.advanceTo(date, 100 * kMostEvents);
    return reached;
  }

  Comparison compare(const SceneKind& kind, bool to_the_end) const {
    const Comparison result = compareLogs(withoutFaintImpacts(truth.collisions(), kind),
                                          withoutFaintImpacts(shadow.collisions(), kind),
                                          withoutFaintImpacts(tested.collisions(), kind),
                                          kind.simulated_time, truth.method().now().seconds());
    if (to_the_end && result.to_the_end) {
      compareStates(truth.states(), shadow.states(), tested.states(), kind);
    }
    return result;
  }

  Trial truth, shadow, tested;
};

class Twin : public testing::TestWithParam<std::tuple<Candidate, SceneKind>> {};

TEST_P(Twin, seesTheSameEvents) {
  const auto& [candidate, kind] = GetParam();
  std::size_t compared = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Trio trio(candidate, randomScene(kind, seed));
    const bool to_the_end = trio.advanceTo(kind.simulated_time);
    compared += trio.compare(kind, to_the_end).compared;
    if (HasFailure()) return;
  }
  EXPECT_GT(compared, 15u) << "the scenes test nothing";
}

/// Changes a scene from outside, in the same way for all three.
class Meddler {
 public:
  Meddler(const SceneKind& kind, const TestScene& scene, std::uint64_t seed)
      : kind_(kind), around_(scene.surroundings), random_(seed) {
    for (std::size_t i = 0; i < scene.balls.size(); ++i) alive_.push_back(static_cast<BallId>(i));
    next_id_ = static_cast<BallId>(scene.balls.size());
  }

  void meddle(Trio& trio) {
    switch (random_.index(4)) {
      case 0:
        return insert(trio);
      case 1:
        return remove(trio);
      case 2:
        return push(trio);
      default:
        return move(trio);
    }
  }

 private:
  // The present balls, as the truth has them.
  std::vector<Ball> present(const Trio& trio) const {
    std::vector<Ball> balls;
    for (const BallId id : alive_) balls.push_back(trio.truth.method().ball(id));
    return balls;
  }

  void insert(Trio& trio) {
    std::vector<Ball> balls = present(trio);
    SceneKind kind = kind_;
    if (kind.large > 1 && random_.chance(0.3)) kind.large = balls.size() + 1;  // one more of these
    if (!addRandomBall(kind, around_, random_.chance(0.1), random_, balls)) return;
    const BallId id = next_id_;
    next_id_ += 1 + static_cast<BallId>(random_.index(3));  // ids may have gaps
    trio.forEach([&](Trial& run) { run.method().insert(id, balls.back()); });
    alive_.push_back(id);
  }

  void remove(Trio& trio) {
    if (alive_.size() < 2) return;
    const std::size_t victim = someBall();
    trio.forEach([&](Trial& run) { run.method().remove(alive_[victim]); });
    alive_.erase(alive_.begin() + static_cast<std::ptrdiff_t>(victim));
  }

  // One of the few large ones no less than one of the others, where there are several.
  std::size_t someBall() {
    const bool large = kind_.large > 1 && random_.chance(0.5);
    return random_.index(large ? std::min(kind_.large, alive_.size()) : alive_.size());
  }

  // @return the place in alive_ of a ball that can be moved, or its size
  std::size_t movable(const Trio& trio) {
    const std::size_t chosen = alive_.empty() ? 0 : someBall();
    const bool ok =
        chosen < alive_.size() && trio.truth.method().ball(alive_[chosen]).mass < kFixed;
    return ok ? chosen : alive_.size();
  }

  void push(Trio& trio) {
    const std::size_t chosen = movable(trio);
    if (chosen == alive_.size()) return;
    const Vector3 velocity =
        random_.chance(0.2) ? Vector3(Vector3::Zero()) : randomVelocity(kind_, random_);
    trio.forEach([&](Trial& run) { run.method().setVelocity(alive_[chosen], velocity); });
  }

  void move(Trio& trio) {
    const std::size_t chosen = movable(trio);
    if (chosen == alive_.size()) return;
    const std::vector<Ball> balls = present(trio);
    Ball ball = balls[chosen];
    ball.position = randomPlace(kind_, random_);
    if (!isFree(around_, balls, ball, chosen)) return;
    ball.velocity = randomVelocity(kind_, random_);
    trio.forEach(
        [&](Trial& run) { run.method().setMotion(alive_[chosen], ball.position, ball.velocity); });
  }

  SceneKind kind_;
  Surroundings around_;
  RandomNumbers random_;
  std::vector<BallId> alive_;
  BallId next_id_;
};

TEST_P(Twin, seesTheSameEventsWhileBallsComeAndGo) {
  const auto& [candidate, kind] = GetParam();
  std::size_t compared = 0;
  for (std::uint64_t seed = 101; seed <= 104; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const TestScene scene = randomScene(kind, seed);
    Trio trio(candidate, scene);
    Meddler meddler(kind, scene, seed);
    RandomNumbers random(seed + 1000);
    double t = 0;
    bool to_the_end = true;
    while (to_the_end && t < kind.simulated_time) {
      t += random.uniform(0, 0.06) * kind.simulated_time;
      to_the_end = trio.advanceTo(t);
      if (to_the_end) meddler.meddle(trio);
    }
    compared += trio.compare(kind, to_the_end).compared;
    if (HasFailure()) return;
  }
  EXPECT_GT(compared, 10u) << "the scenes test nothing";
}

INSTANTIATE_TEST_SUITE_P(FastMethods, Twin,
                         testing::Combine(testing::ValuesIn(candidates()),
                                          testing::ValuesIn(sceneKinds())),
                         [](const auto& instance) {
                           const Candidate& candidate = std::get<0>(instance.param);
                           return candidate.method +
                                  (candidate.precision == Precision::long_double ? "_long_double_"
                                                                                 : "_double_") +
                                  std::get<1>(instance.param).name;
                         });

/// Scenes whose balls all touch at the start, so that the order of simultaneous impacts counts.
TestScene touchingChain(std::size_t count, double speed) {
  TestScene scene;  // on a line, at places that doubles hold exactly
  for (std::size_t i = 0; i < count; ++i) {
    scene.balls.push_back({Vector3(double(i), 0, 0), Vector3::Zero(), 0.5, 1});
  }
  scene.balls.front().velocity.x() = speed;
  return scene;
}

TestScene touchingGrid(bool push_corner) {
  TestScene scene;  // a cube of 27 balls, each touching up to six
  for (int i = 0; i < 27; ++i) {
    scene.balls.push_back({Vector3(i % 3, i / 3 % 3, i / 9), Vector3::Zero(), 0.5, 1.0 + i % 2});
  }
  scene.balls[push_corner ? 0 : 13].velocity = Vector3(1, 0.5, 0.25);
  scene.surroundings.box.min = Vector3::Constant(-2.5);
  scene.surroundings.box.max = Vector3::Constant(4.5);
  return scene;
}

class TouchingTwin : public testing::TestWithParam<Candidate> {};

TEST_P(TouchingTwin, resolvesSimultaneousImpactsInTheSameOrder) {
  const std::vector<TestScene> scenes = {touchingChain(7, 1), touchingGrid(true),
                                         touchingGrid(false)};
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    SCOPED_TRACE("scene " + std::to_string(i));
    Trial twin(kSlowTwin, scenes[i], GetParam().precision);
    Trial tested(GetParam().method, scenes[i], GetParam().precision);
    // Up to here all impacts are of balls that touch from the start: nothing has rounded dates.
    twin.advanceTo(1e-9);
    tested.advanceTo(1e-9);
    ASSERT_EQ(twin.collisions().size(), tested.collisions().size());
    ASSERT_GT(twin.collisions().size(), 2u);
    for (std::size_t k = 0; k < twin.collisions().size(); ++k) {
      EXPECT_EQ(twin.collisions()[k].a, tested.collisions()[k].a) << "impact " << k;
      EXPECT_EQ(twin.collisions()[k].b, tested.collisions()[k].b) << "impact " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(FastMethods, TouchingTwin, testing::ValuesIn(candidates()),
                         [](const auto& instance) {
                           const bool is_long = instance.param.precision == Precision::long_double;
                           return instance.param.method + (is_long ? "_long_double" : "_double");
                         });

}  // namespace
}  // namespace test
}  // namespace ball_sim::core
