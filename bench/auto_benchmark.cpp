// How good the choice of `auto` is: its CPU time on many scenes beside that of every method that
// keeps the scene's tolerance. The aim: never more than 1.3 times the cheapest, and never a method
// that does not keep it.
//
// usage: auto_benchmark [SCENE.yaml ...] [WORD]
// Without scenes: those made here, of every kind that the choice is about, or those of them with
// WORD in their names. Each method that keeps the tolerance runs a scene for the same simulated
// time, in turns, three times; the median counts. Set-up and a first tenth are not counted. A
// method that needs more than 5 s of CPU time is given up. Short runs are timed many together, each
// in a world of its own. A scene that takes less than 10 us as a whole is shown, but does not
// count. brute_force is shown where all pairs are few, and is no choice of auto's.
//
// After a scene in which balls come to lie on balls, what the change to steps is decided by: the
// CPU time of an event of event_driven and of a step of a ball of discrete, there and then.
//
// What keeps a tolerance: places below the horizon of chaos are within it of those of event_driven
// in long double. A scene in which balls come to lie on balls has no such places; there it is the
// energy, which must not grow, and the overlap, which must be less than a radius.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/fill.hpp"
#include "ball_sim/method_choice.hpp"
#include "ball_sim/scene_reader.hpp"
#include "ball_sim/text.hpp"
#include "ball_sim/world.hpp"

namespace ball_sim::core {
namespace {

constexpr double kMostSeconds = 5;  // CPU
constexpr double kGivenUp = std::numeric_limits<double>::infinity();
constexpr int kRepeats = 3;
constexpr std::size_t kFew = 20;       // balls: so many, and brute_force is looked at too
constexpr double kShortestRun = 1e-5;  // s, CPU: below it is the calls that cost, not the balls
constexpr double kDefaultTolerance = 1e-6;  // of a radius, where the scene names none

double cpuSeconds() {
  timespec time = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Case {
  Scene scene;
  double seconds = 0;  // simulated
  bool piles = false;
};

struct Outcome {
  std::optional<double> cpu;  // s per simulated second; nothing: given up
  bool keeps = false;
  double error = 0;    // of a radius; of piles: energy gained, of what there was
  double overlap = 0;  // of a radius
  MethodChoice method;
};

// Advances in pieces, so that it can be given up. @return whether `target` was reached
bool advance(World& world, double target, double budget) {
  const double start = cpuSeconds();
  while (!world.advanceTo(Time::fromSeconds(target), 20000)) {
    if (cpuSeconds() - start > budget) return false;
  }
  return true;
}

WorldOptions optionsOf(const std::string& method) {
  WorldOptions options;
  options.method = method;
  return options;
}

void describe(const Case& test, const World& world, double energy, Outcome& outcome) {
  outcome.method = world.method();
  const double radius = *std::min_element(world.radii().begin(), world.radii().end());
  outcome.overlap = world.statistics().deepest_overlap / radius;
  if (!test.piles) return;
  const double gain = world.kineticEnergy() + world.potentialEnergy() - energy;
  outcome.error = std::max(0.0, gain / std::abs(energy));
  outcome.keeps = outcome.error < 1e-9 && outcome.overlap < 1;
}

// CPU time of a simulated second, s: of a run without its first tenth, the mean of `copies` timed
// together.
double timeRuns(const Case& test, const std::string& method, int copies, Outcome& outcome) {
  std::vector<std::unique_ptr<World>> worlds;
  for (int i = 0; i < copies; ++i) {
    worlds.push_back(std::make_unique<World>(test.scene, optionsOf(method)));
  }
  const double energy = worlds[0]->kineticEnergy() + worlds[0]->potentialEnergy();
  for (const auto& world : worlds) {
    if (!advance(*world, test.seconds / 10, kMostSeconds)) return kGivenUp;
  }
  const double start = cpuSeconds();
  for (const auto& world : worlds) {
    if (!advance(*world, test.seconds, kMostSeconds)) return kGivenUp;
  }
  const double cpu = (cpuSeconds() - start) / (0.9 * test.seconds * copies);
  describe(test, *worlds[0], energy, outcome);
  return cpu;
}

// The mean of as many runs as can be timed.
double timeToRun(const Case& test, const std::string& method, Outcome& outcome) {
  constexpr double kEnough = 0.05;   // s
  constexpr double kShort = 200e-6;  // s: below it reading the clock counts
  constexpr int kCopies = 50;
  constexpr int kMostRuns = 10000;
  const double once = timeRuns(test, method, 1, outcome);
  if (std::isinf(once)) return kGivenUp;
  const int copies = once * test.seconds < kShort ? kCopies : 1;
  double sum = 0;
  int runs = 0;
  while (runs < kMostRuns && sum * test.seconds < kEnough) {
    sum += copies * timeRuns(test, method, copies, outcome);
    runs += copies;
  }
  return sum / runs;
}

// Before any ball is at the horizon: of the collisions of a ball, a Poisson process, the worst of
// 10^5 balls has five standard deviations more than the typical one.
double checkedTime(const Case& test) {
  World world(test.scene, optionsOf("event_driven"));
  std::vector<Ball> balls;
  for (const BallId id : world.ids()) balls.push_back(world.ball(id));
  const SceneNumbers numbers = sceneNumbers(world.surroundings(), balls);
  if (!(numbers.collision_rate > 0)) return std::min(1.0, test.seconds);
  const double tolerance = test.scene.tolerance.value_or(kDefaultTolerance);
  const double most = horizonInCollisions(numbers.bits_per_collision, tolerance);
  const double root = std::sqrt(6.25 + most) - 2.5;  // of c, where c + 5 sqrt(c) is the most
  return std::min(test.seconds, root * root / numbers.collision_rate);
}

void checkPlaces(const Case& test, const std::string& method, Outcome& outcome) {
  const double date = checkedTime(test);
  outcome.error = 0;
  WorldOptions exact = optionsOf("event_driven");
  exact.precision = Precision::long_double;
  World reference(test.scene, exact);
  World tested(test.scene, optionsOf(method));
  if (!advance(reference, date, kMostSeconds) || !advance(tested, date, kMostSeconds)) {
    outcome.error = std::numeric_limits<double>::infinity();
    return;
  }
  BallStates there;
  BallStates here;
  reference.read(there);
  tested.read(here);
  const Surroundings& around = tested.surroundings();
  for (std::size_t i = 0; i < here.ids.size(); ++i) {
    Vector3 off = here.positions[i] - there.positions[i];
    for (int axis = 0; around.periodic && axis < (around.planar() ? 2 : 3); ++axis) {
      const double edge = around.box.max[axis] - around.box.min[axis];
      off[axis] -= edge * std::round(off[axis] / edge);
    }
    outcome.error = std::max(outcome.error, off.norm() / tested.radii()[i]);
  }
  outcome.keeps = outcome.error <= test.scene.tolerance.value_or(kDefaultTolerance);
}

// --- scenes

Scene fluid(bool planar, std::size_t count, double packing_fraction, Range radius) {
  Scene scene;
  scene.name =
      std::string(planar ? "discs " : "spheres ") + std::to_string(count) + " at " +
      std::to_string(packing_fraction).substr(0, 5) +
      (radius.upper > radius.lower ? " 1:" + formatShort(radius.upper / radius.lower) : "");
  scene.surroundings.periodic = true;
  if (planar) scene.surroundings.box.min.z() = scene.surroundings.box.max.z() = 0;
  Fill fill;
  fill.count = count;
  fill.radius = radius;
  fill.density = 1000;
  fill.speed_sigma = 1;
  fill.seed = 1;
  fill.packing_fraction = packing_fraction;
  scene.fill = {fill};
  return scene;
}

Scene poured(std::size_t count, double restitution) {
  Scene scene;
  scene.name =
      "pile of " + std::to_string(count) + ", e = " + std::to_string(restitution).substr(0, 3);
  scene.surroundings.gravity = Vector3(0, 0, -9.81);
  scene.surroundings.restitution = restitution;
  const double edge = std::cbrt(static_cast<double>(count) / 1000);
  scene.surroundings.box.min = Vector3::Zero();
  scene.surroundings.box.max = Vector3(edge, edge, 3 * edge);
  Fill fill;
  fill.count = count;
  fill.radius = {0.03, 0.04};
  fill.density = 1000;
  fill.speed_sigma = 0.1;
  fill.seed = 2;
  scene.fill = {fill};
  return scene;
}

Scene bouncing() {
  Scene scene = poured(1000, 1);
  scene.name = "bouncing 1000, e = 1";
  return scene;
}

Scene stack() {
  Scene scene;
  scene.name = "stack of 10, e = 0.5";
  scene.surroundings.gravity = Vector3(0, 0, -9.81);
  scene.surroundings.restitution = 0.5;
  scene.surroundings.box.min = Vector3(-0.05, -0.05, 0);
  scene.surroundings.box.max.x() = scene.surroundings.box.max.y() = 0.05;
  for (int i = 0; i < 10; ++i) {
    scene.balls.push_back({Vector3(0, 0, 0.05 + 0.1 * i), Vector3::Zero(), 0.05, 1});
  }
  return scene;
}

// Balls in a row along x, radius 0.5, with gaps.
Scene chain(const std::string& name, const std::vector<double>& masses, double gap, double speed) {
  Scene scene;
  scene.name = name;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const double x = 0.5 + static_cast<double>(i + 1) * (1 + gap);
    scene.balls.push_back({Vector3(x, 0, 0), Vector3::Zero(), 0.5, masses[i]});
  }
  scene.balls.back().velocity.x() = -speed;
  scene.surroundings.box.min.x() = 0;
  return scene;
}

Scene twelveDiscs() {
  Scene scene = fluid(true, 12, 0.3, {0.05, 0.05});
  scene.name = "twelve discs in a box";
  scene.surroundings.periodic = false;
  return scene;
}

Scene bullet() {
  Scene scene = fluid(false, 500, 0.1, {0.05, 0.05});
  scene.balls = {{Vector3::Zero(), Vector3(1000, 0, 0), 0.01, 0.1}};
  scene.name = "bullet of 1 km/s into a gas";
  return scene;
}

std::vector<Case> ownCases() {
  const Range one = {0.05, 0.05};
  std::vector<Case> cases;
  for (const std::size_t count : {1000u, 10000u, 100000u}) {
    const double share = 1000.0 / static_cast<double>(count);
    cases.push_back({fluid(false, count, 0.001, one), 100 * share, false});
    cases.push_back({fluid(false, count, 0.05, one), 20 * share, false});
    cases.push_back({fluid(false, count, 0.2, one), 10 * share, false});
    cases.push_back({fluid(false, count, 0.45, one), 2 * share, false});
    cases.push_back({fluid(true, count, 0.2, one), 20 * share, false});
    cases.push_back({fluid(true, count, 0.6, one), 4 * share, false});
  }
  cases.push_back({chain("pi billiard, k = 3", {1, 1e6}, 1, 1), 10, false});
  cases.push_back({chain("cradle with gaps", {1, 1, 1, 1, 1}, 0.1, 1), 10, false});
  cases.push_back({twelveDiscs(), 10, false});
  cases.push_back({fluid(false, 100, 0.105, one), 20, false});
  cases.push_back({fluid(false, 100, 0.471, one), 5, false});
  cases.push_back({bullet(), 0.2, false});
  cases.push_back({fluid(false, 5000, 0.2, {0.05, 0.15}), 2, false});
  cases.push_back({fluid(false, 5000, 0.2, {0.01, 0.1}), 1, false});
  cases.push_back({bouncing(), 2, false});
  cases.push_back({poured(300, 0.5), 10, true});
  cases.push_back({poured(300, 0.9), 10, true});
  cases.push_back({stack(), 20, true});
  return cases;
}

Case fromFile(const std::string& path) {
  Case test;
  test.scene = readScene(path);
  test.seconds = 10;
  const Surroundings& around = test.scene.surroundings;
  test.piles = around.gravity != Vector3::Zero() && around.restitution < 1;
  return test;
}

// --- the table

void printRow(const Case& test, const Outcome& outcome, const std::string& asked, double least) {
  std::printf("%-28s %-13s", test.scene.name.c_str(), asked.c_str());
  if (outcome.cpu) {
    std::printf(" %10.3g", *outcome.cpu);
  } else {
    std::printf(" %10s", "-");
  }
  std::printf(" %9.2g %9.2g  %-4s", outcome.error, outcome.overlap, outcome.keeps ? "yes" : "no");
  if (asked == "auto" && outcome.cpu) {
    std::printf(" %5.2f  %s (%s)", *outcome.cpu / least, outcome.method.name.c_str(),
                outcome.method.reason.c_str());
  }
  std::printf("\n");
}

// When auto changes over to steps, s; nothing: it does not.
std::optional<double> startOfSteps(const Case& test) {
  World world(test.scene, optionsOf("auto"));
  for (int part = 1; part <= 200; ++part) {
    const double date = test.seconds * part / 200;
    if (!advance(world, date, kMostSeconds)) return std::nullopt;
    if (world.method().name == "discrete") return date;
  }
  return std::nullopt;
}

// CPU time of an event of a method, s; an event of discrete is a step of a ball.
double costOfEvent(const Case& test, const std::string& method, double from) {
  constexpr std::uint64_t kEvents = 200'000;
  World world(test.scene, optionsOf(method));
  if (!advance(world, from, kMostSeconds)) return kGivenUp;
  const std::uint64_t before = world.statistics().events;
  const double start = cpuSeconds();
  world.advanceTo(Time::fromSeconds(from + test.seconds), kEvents);
  const double cpu = cpuSeconds() - start;
  return cpu / static_cast<double>(world.statistics().events - before);
}

void printPileCosts(const Case& test) {
  const std::optional<double> from = startOfSteps(test);
  if (!from) return;
  std::vector<double> events;
  std::vector<double> steps;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    events.push_back(costOfEvent(test, "event_driven", *from));
    steps.push_back(costOfEvent(test, "discrete", *from));
  }
  std::sort(events.begin(), events.end());
  std::sort(steps.begin(), steps.end());
  std::printf("%-28s at %.2f s: event of event_driven %.0f ns, step of a ball %.0f ns\n",
              test.scene.name.c_str(), *from, 1e9 * events[kRepeats / 2],
              1e9 * steps[kRepeats / 2]);
}

// @return the cost of auto in units of the cheapest that keeps the tolerance; 0: too short to tell
double runCase(Case test) {
  // Filling a scene may take longer than running it: once is enough.
  test.scene.balls = populate(test.scene);
  test.scene.fill.clear();
  std::vector<std::string> names;
  for (const std::string& name : methodNames()) {
    const bool all_pairs = name == "brute_force";
    if (name != "auto" && (!all_pairs || test.scene.balls.size() <= kFew)) names.push_back(name);
  }
  names.push_back("auto");
  std::vector<Outcome> outcomes(names.size());
  std::vector<std::vector<double>> times(names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!test.piles) checkPlaces(test, names[i], outcomes[i]);
  }
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!test.piles && !outcomes[i].keeps) continue;
      if (!times[i].empty() && std::isinf(times[i].back())) continue;
      times[i].push_back(timeToRun(test, names[i], outcomes[i]));
    }
  }
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (times[i].empty() || std::isinf(times[i].back())) continue;
    std::sort(times[i].begin(), times[i].end());
    outcomes[i].cpu = times[i][times[i].size() / 2];
    const bool is_choice = names[i] != "auto" && names[i] != "brute_force";
    if (is_choice && outcomes[i].keeps) least = std::min(least, *outcomes[i].cpu);
  }
  for (std::size_t i = 0; i < names.size(); ++i) printRow(test, outcomes[i], names[i], least);
  if (test.piles) printPileCosts(test);
  std::fflush(stdout);
  const Outcome& own = outcomes.back();
  if (!own.cpu || !own.keeps) return std::numeric_limits<double>::infinity();
  return least * test.seconds < kShortestRun ? 0 : *own.cpu / least;
}

int run(const std::vector<std::string>& arguments) {
  std::vector<Case> cases;
  std::string word;
  for (const std::string& argument : arguments) {
    if (argument.find(".yaml") == std::string::npos) {
      word = argument;
    } else {
      cases.push_back(fromFile(argument));
    }
  }
  if (cases.empty()) cases = ownCases();
  std::printf("%-28s %-13s %10s %9s %9s  %s %s\n", "scene", "method", "CPU s/s", "error/r",
              "overlap/r", "keeps", "auto/cheapest");
  double worst = 0;
  for (const Case& test : cases) {
    if (test.scene.name.find(word) != std::string::npos) worst = std::max(worst, runCase(test));
  }
  std::printf("worst: %.2f times the cheapest that keeps the tolerance\n", worst);
  return 0;
}

}  // namespace
}  // namespace ball_sim::core

int main(int argc, char** argv) {
  return ball_sim::core::run(std::vector<std::string>(argv + 1, argv + argc));
}
