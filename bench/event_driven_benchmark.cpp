// How many ball-ball collisions event_driven resolves per second of CPU time, one thread.
//
// States: equal elastic spheres in a periodic cube at three packing fractions and four sizes,
// discs, a polydisperse mix, walls, gravity. Setting up and mixing are not timed. Each row carries
// its witnesses: energy drift, deepest overlap, collision rate against Enskog's theory, state hash.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "ball_sim/fill.hpp"
#include "ball_sim/methods.hpp"
#include "ball_sim/observables.hpp"
#include "ball_sim/random_source.hpp"

namespace ball_sim::core {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// A state point. Lengths in diameters, masses 1, velocity components of standard deviation 1.
struct StatePoint {
  std::string name;
  double packing_fraction = 0;
  std::size_t count = 0;  // of the balls that are mixed
  int tiles = 1;          // copies along each axis of what was mixed
  bool planar = false;
  bool periodic = true;
  double gravity = 0;           // m/s^2, downwards
  double largest_radius = 0.5;  // m; the smallest is 0.5
  double mix = 200;             // collisions per ball before the copies are made
};

struct Prepared {
  Surroundings surroundings;
  std::vector<Ball> balls;
};

std::unique_ptr<Method> makeRun(const Prepared& prepared) {
  auto method = makeMethod("event_driven", prepared.surroundings);
  for (std::size_t i = 0; i < prepared.balls.size(); ++i) {
    method->insert(static_cast<BallId>(i), prepared.balls[i]);
  }
  return method;
}

/// Runs until so many collisions per ball have happened; the time that took, s.
double runFor(Method& method, double collisions_per_ball, std::size_t balls) {
  const auto goal = static_cast<std::uint64_t>(collisions_per_ball * double(balls) / 2);
  const std::uint64_t before = method.statistics().ball_collisions;
  const Time start = method.now();
  double step = 0.01;
  while (method.statistics().ball_collisions - before < goal) {
    const std::uint64_t so_far = method.statistics().ball_collisions;
    method.advanceTo(method.now() + step);
    const std::uint64_t more = method.statistics().ball_collisions - so_far;
    if (more * 20 < goal) step *= 2;
  }
  return method.now() - start;
}

std::vector<double> massesOf(const std::vector<Ball>& balls) {
  std::vector<double> masses;
  for (const Ball& ball : balls) masses.push_back(ball.mass);
  return masses;
}

/// Random places (a lattice with vacancies where it is dense), mixed, then copied side by side with
/// new velocities: an equilibrium of any size in little time.
Prepared prepare(const StatePoint& point) {
  Scene scene;
  if (point.planar) scene.surroundings.box.min.z() = scene.surroundings.box.max.z() = 0;
  scene.surroundings.periodic = point.periodic;
  Fill fill;
  fill.count = point.count;
  fill.radius = {0.5, point.largest_radius};
  fill.density = 1 / (4.0 / 3 * kPi * 0.125);  // a ball of radius 0.5 m has 1 kg
  fill.speed_sigma = 1;
  fill.seed = 1;
  fill.packing_fraction = point.packing_fraction;
  scene.fill = {fill};
  Prepared prepared;
  prepared.balls = populate(scene);
  prepared.surroundings = scene.surroundings;
  const auto method = makeRun(prepared);
  runFor(*method, point.mix, prepared.balls.size());
  BallStates mixed;
  method->read(mixed);

  Box& box = prepared.surroundings.box;
  const Vector3 edge = box.max - box.min;
  const std::vector<Ball> tile = prepared.balls;
  prepared.balls.clear();
  for (int x = 0; x < point.tiles; ++x) {
    for (int y = 0; y < point.tiles; ++y) {
      for (int z = 0; z < (point.planar ? 1 : point.tiles); ++z) {
        for (std::size_t i = 0; i < tile.size(); ++i) {
          Ball ball = tile[i];
          ball.position = mixed.positions[i] + Vector3(x * edge.x(), y * edge.y(), z * edge.z());
          prepared.balls.push_back(ball);
        }
      }
    }
  }
  box.max = box.min + point.tiles * edge;
  if (point.planar) box.max.z() = box.min.z();

  // Random order in memory, as after a long run, and velocities that no two copies share.
  RandomSource random(2);
  for (std::size_t i = prepared.balls.size() - 1; i > 0; --i) {
    const auto j = static_cast<std::size_t>(random.uniform() * double(i + 1));
    std::swap(prepared.balls[i], prepared.balls[j]);
  }
  for (Ball& ball : prepared.balls) {
    const double sigma = 1 / std::sqrt(ball.mass);
    ball.velocity = sigma * Vector3(random.normal(), random.normal(), random.normal());
    if (point.planar) ball.velocity.z() = 0;
  }
  prepared.surroundings.gravity = Vector3(0, 0, -point.gravity);
  return prepared;
}

/// Enskog's collisions per ball and second for equal balls of unit diameter, mass and temperature,
/// with the contact value of Carnahan and Starling (spheres) or Henderson (discs).
double enskogRate(double eta, bool planar) {
  if (planar) {
    const double density = 4 * eta / kPi;
    return 2 * std::sqrt(kPi) * density * (1 - 7 * eta / 16) / ((1 - eta) * (1 - eta));
  }
  const double density = 6 * eta / kPi;
  return 4 * std::sqrt(kPi) * density * (1 - eta / 2) / std::pow(1 - eta, 3);
}

void measure(benchmark::State& state, const StatePoint& point) {
  const Prepared prepared = prepare(point);
  const std::size_t count = prepared.balls.size();
  const std::vector<double> masses = massesOf(prepared.balls);
  const auto method = makeRun(prepared);
  const double time_per_collision = runFor(*method, 4, count) / 4;
  BallStates states;
  method->read(states);
  const auto energy = [&] {
    return kineticEnergy(states, masses) +
           potentialEnergy(states, masses, prepared.surroundings.gravity);
  };
  const double energy_before = energy();
  const Statistics before = method->statistics();
  const Time start = method->now();
  const double step = std::min(8.0, std::max(1.0, 3e5 / double(count))) * time_per_collision;
  for (auto _ : state) method->advanceTo(method->now() + step);

  const Statistics after = method->statistics();
  method->read(states);
  const double collisions = double(after.ball_collisions - before.ball_collisions);
  using benchmark::Counter;
  state.counters["coll/s"] = Counter(collisions, Counter::kIsRate);
  state.counters["s/coll"] = Counter(collisions, Counter::kIsRate | Counter::kInvert);
  state.counters["events/s"] = Counter(double(after.events - before.events), Counter::kIsRate);
  state.counters["bytes/ball"] = double(after.bytes) / double(count);
  state.counters["drift"] = energy() / energy_before - 1;
  state.counters["overlap"] = after.deepest_overlap;
  const double rate = 2 * collisions / double(count) / (method->now() - start);
  state.counters["rate"] = rate;
  const bool equal = point.largest_radius == 0.5 && point.gravity == 0;
  if (equal)
    state.counters["rate/Enskog"] = rate / enskogRate(point.packing_fraction, point.planar);
  state.SetLabel("hash " + std::to_string(stateHash(states)));
}

std::vector<StatePoint> statePoints() {
  std::vector<StatePoint> points;
  const auto add = [&](const std::string& name, double eta, std::size_t count, int tiles) {
    StatePoint point;
    point.name = name;
    point.packing_fraction = eta;
    point.count = count;
    point.tiles = tiles;
    points.push_back(point);
    return &points.back();
  };
  for (const double eta : {0.05, 0.2, 0.49}) {
    const std::string name = "spheres/" + std::to_string(eta).substr(0, 4) + "/";
    add(name + "1e3", eta, 1000, 1);
    add(name + "1e4", eta, 1250, 2);
    add(name + "1e5", eta, 12500, 2);
    add(name + "1e6", eta, 15625, 4);
  }
  for (const double eta : {0.2, 0.6}) {
    add("discs/" + std::to_string(eta).substr(0, 3) + "/1e4", eta, 10000, 1)->planar = true;
  }
  add("mix_1_to_3/0.20/1e4", 0.2, 10000, 1)->largest_radius = 1.5;
  add("walls/0.20/1e4", 0.2, 10000, 1)->periodic = false;
  StatePoint* falling = add("gravity/0.20/1e4", 0.2, 10000, 1);
  falling->periodic = false;
  falling->gravity = 0.1;
  return points;
}

}  // namespace
}  // namespace ball_sim::core

int main(int argc, char** argv) {
  using namespace ball_sim::core;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  for (const StatePoint& point : statePoints()) {
    benchmark::RegisterBenchmark(point.name.c_str(), measure, point)->Unit(benchmark::kMillisecond);
  }
  benchmark::RunSpecifiedBenchmarks();
}
