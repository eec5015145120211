// Stability map: where each method holds, degrades and fails, as CSV for a plot.
//
//   stability_map > stability_map.csv      (half a minute; progress on the terminal)
//
// Small gases of hard balls in a periodic box, seeded and well mixed, from the same start for every
// method. Along x: speed times time step over radius, with the root-mean-square speed of the
// lighter balls. Along y, one map each: the packing fraction, the restitution, the mass ratio
// (every other ball is heavier, at the same mean kinetic energy); what does not vary is at 0.2, 1
// and 1. soft_sphere has contacts of 50 steps. A method without a time step is the same at every x.
// event_driven is the reference.
//
// Measured over eight starts, each for a time in which the reference counts 1.5 impacts a ball, or
// 0.4 s: so short that chaos does not yet make two right methods count differently, but by 0.02.
//   energy_error                 energy less the reference's, over the energy at first, root mean
//                                square of the starts; springs count
//   deepest_overlap_per_radius   the deepest of all
//   missed_share                 1 - impacts counted / impacts of the reference; 1 where the time
//                                is over before the first step
// Verdict, by the worst of the three, which the column reason names:
//   holds     energy within 0.01, overlap within 0.05, impacts within 0.05: figures of a plot agree
//   degrades  within 0.1, 0.5 and 0.2: it looks right and is not
//   fails     beyond; or it refused to run, and reason says why
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <exception>
#include <string>
#include <vector>

#include "ball_sim/fill.hpp"
#include "ball_sim/world.hpp"

namespace ball_sim::core {
namespace {

constexpr std::size_t kBalls = 150;
constexpr double kRadius = 0.05;  // m
constexpr double kSigma = 1;      // m/s, of each component of the lighter balls' velocities
constexpr double kImpactsPerBall = 1.5;
constexpr double kLongest = 0.4;  // s
constexpr double kMixingImpactsPerBall = 10;
constexpr std::uint64_t kStarts = 8;
constexpr double kPi = 3.14159265358979323846;

/// What a scene of the map is made of.
struct Point {
  double packing_fraction = 0.2;
  double restitution = 1;
  double mass_ratio = 1;
};

struct Map {
  const char* name;  // of the column that varies
  std::vector<Point> points;
};

std::vector<Map> maps() {
  std::vector<Map> all = {{"packing_fraction", {}}, {"restitution", {}}, {"mass_ratio", {}}};
  for (const double value : {0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5}) {
    all[0].points.push_back({value, 1, 1});
  }
  for (const double value : {1.0, 0.99, 0.95, 0.9, 0.8, 0.5, 0.2}) {
    all[1].points.push_back({0.2, value, 1});
  }
  for (const double value : {1.0, 10.0, 1e2, 1e3, 1e4, 1e6}) {
    all[2].points.push_back({0.2, 1, value});
  }
  return all;
}

const std::vector<double>& stepsPerRadius() {
  static const std::vector<double> values = {1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1, 3};
  return values;
}

/// A scene of a point, its balls placed. Every other ball has the larger mass.
Scene sceneOf(const Point& point, std::uint64_t seed) {
  Scene scene;
  const double volume = double(kBalls) * 4 / 3 * kPi * std::pow(kRadius, 3);
  const double edge = std::cbrt(volume / point.packing_fraction);
  scene.surroundings.box = {Vector3::Zero(), Vector3::Constant(edge)};
  scene.surroundings.periodic = true;
  scene.surroundings.restitution = point.restitution;
  Fill fill;
  fill.count = kBalls;
  fill.radius = {kRadius, kRadius};
  fill.mass = Range{1, 1};
  fill.speed_sigma = kSigma;
  fill.seed = seed;
  scene.fill = {fill};
  scene.balls = populate(scene);
  scene.fill.clear();
  for (std::size_t i = 0; i < scene.balls.size(); i += 2) {
    scene.balls[i].mass = point.mass_ratio;
    scene.balls[i].velocity /= std::sqrt(point.mass_ratio);
  }
  return scene;
}

double energyOf(const World& world) { return world.kineticEnergy() + world.potentialEnergy(); }

double impactsOf(const World& world) { return double(world.statistics().ball_collisions); }

World exactly(const Scene& scene) {
  WorldOptions options;
  options.method = "event_driven";
  return World(scene, options);
}

/// The scene after a while without loss, so that no trace of how it was filled is left.
Scene mixed(const Scene& scene) {
  Scene elastic = scene;
  elastic.surroundings.restitution = 1;
  World world = exactly(elastic);
  for (int i = 1; impactsOf(world) < kMixingImpactsPerBall * double(kBalls) / 2; ++i) {
    world.advanceTo(Time::fromSeconds(0.01 * i));
  }
  Scene after = scene;
  for (std::size_t i = 0; i < after.balls.size(); ++i) {
    after.balls[i] = world.ball(static_cast<BallId>(i));
  }
  return after;
}

/// One start of a point, and what the exact method makes of it.
struct Start {
  Scene scene;
  double seconds = 0;        // for which all run
  double energy_before = 0;  // J
  double energy = 0;         // J
  double impacts = 0;
};

Start startOf(const Point& point, std::uint64_t seed) {
  Start start;
  start.scene = mixed(sceneOf(point, seed));
  World world = exactly(start.scene);
  start.energy_before = energyOf(world);
  const double enough = kImpactsPerBall * double(kBalls) / 2;  // each is one of two balls
  while (start.impacts < enough && start.seconds < kLongest) {
    start.seconds += 1e-4;
    world.advanceTo(Time::fromSeconds(start.seconds));
    start.impacts = impactsOf(world);
  }
  start.energy = energyOf(world);
  return start;
}

struct Measured {
  double energy_error = 0;
  double overlap = 0;  // of the radius
  double missed = 0;   // share
  double impacts = 0;
  double reference_impacts = 0;
  double seconds = 0;  // simulated
  double cpu = 0;      // s
  std::string refusal;
};

double cpuSeconds() { return double(std::clock()) / CLOCKS_PER_SEC; }

void measureOne(const Start& start, const WorldOptions& options, Measured& measured) {
  World world(start.scene, options);
  const double before = cpuSeconds();
  world.advanceTo(Time::fromSeconds(start.seconds));
  measured.cpu += cpuSeconds() - before;
  const double error = (energyOf(world) - start.energy) / start.energy_before;
  measured.energy_error += error * error / double(kStarts);
  measured.overlap = std::max(measured.overlap, world.statistics().deepest_overlap / kRadius);
  measured.impacts += impactsOf(world);
  measured.reference_impacts += start.impacts;
  measured.seconds += start.seconds;
}

Measured measure(const std::vector<Start>& starts, const std::string& method, double time_step) {
  Measured measured;
  WorldOptions options;
  options.method = method;
  options.time_step = time_step;
  try {
    for (const Start& start : starts) measureOne(start, options, measured);
  } catch (const std::exception& error) {
    measured.refusal = error.what();
  }
  measured.energy_error = std::sqrt(measured.energy_error);
  measured.missed = 1 - measured.impacts / measured.reference_impacts;
  return measured;
}

struct Verdict {
  const char* word;
  std::string reason;
};

/// Holds within the first bound, degrades within the second.
struct Bound {
  const char* name;
  double value;
  double holds;
  double degrades;

  double badness() const {  // 1: holds no more, 2: degrades no more
    const double size = std::abs(value);
    if (!(size < 1e300)) return 1e300;
    return size <= holds ? size / holds : 1 + size / degrades;
  }
};

Verdict judge(const Measured& measured) {
  if (!measured.refusal.empty()) return {"fails", "refused: " + measured.refusal};
  const std::vector<Bound> bounds = {{"energy_error", measured.energy_error, 0.01, 0.1},
                                     {"deepest_overlap_per_radius", measured.overlap, 0.05, 0.5},
                                     {"missed_share", measured.missed, 0.05, 0.2}};
  const auto worst =
      std::max_element(bounds.begin(), bounds.end(),
                       [](const Bound& a, const Bound& b) { return a.badness() < b.badness(); });
  if (worst->badness() <= 1) return {"holds", "all within bounds"};
  return {worst->badness() <= 2 ? "degrades" : "fails", worst->name};
}

/// A field of CSV: quoted, with the quotes in it doubled.
std::string quoted(const std::string& text) {
  std::string field = "\"";
  for (const char c : text) {
    if (c == '"') field += '"';
    field += c;
  }
  return field + "\"";
}

void printRow(const Map& map, const std::string& method, double x, const Point& point,
              const Measured& measured) {
  const Verdict verdict = judge(measured);
  std::printf("%s,%s,%g,%g,%g,%g,%s,%s,%.6g,%.6g,%.6g,%.0f,%.0f,%.4g,%.3g\n", map.name,
              method.c_str(), x, point.packing_fraction, point.restitution, point.mass_ratio,
              verdict.word, quoted(verdict.reason).c_str(), measured.energy_error, measured.overlap,
              measured.missed, measured.impacts, measured.reference_impacts, measured.seconds,
              measured.cpu);
  std::fflush(stdout);
}

bool hasTimeStep(const std::string& method) { return method != "event_driven"; }

/// All methods but those that only tell how others are chosen or tested.
std::vector<std::string> methodsToMap() {
  std::vector<std::string> names;
  for (const std::string& name : methodNames()) {
    if (name != "auto" && name != "brute_force") names.push_back(name);
  }
  return names;
}

void run() {
  std::puts(
      "map,method,speed_time_step_per_radius,packing_fraction,restitution,mass_ratio,verdict,"
      "reason,"
      "energy_error,deepest_overlap_per_radius,missed_share,impacts,reference_impacts,"
      "simulated_seconds,cpu_seconds");
  std::size_t done = 0;
  std::size_t all = 0;
  for (const Map& map : maps()) all += map.points.size();
  for (const Map& map : maps()) {
    for (const Point& point : map.points) {
      std::vector<Start> starts;
      for (std::uint64_t seed = 1; seed <= kStarts; ++seed) starts.push_back(startOf(point, seed));
      for (const std::string& method : methodsToMap()) {
        Measured measured;
        bool is_measured = false;
        for (const double x : stepsPerRadius()) {
          const double time_step = x * kRadius / (std::sqrt(3.0) * kSigma);
          if (!is_measured) measured = measure(starts, method, time_step);
          is_measured = !hasTimeStep(method);
          printRow(map, method, x, point, measured);
        }
      }
      std::fprintf(stderr, "\rstability map: %zu of %zu scenes", ++done, all);
    }
  }
  std::fputs("\n", stderr);
}

}  // namespace
}  // namespace ball_sim::core

int main() {
  ball_sim::core::run();
  return 0;
}
