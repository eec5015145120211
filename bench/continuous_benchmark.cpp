// What a second of a gas costs, frame by frame, by continuous and by event_driven in turns.
//
// The gas that other engines were measured on: closed box, balls of 0.05 m and 1 kg, Gaussian
// velocities of 1 m/s an axis, packing fraction 0.1, elastic, without gravity; frames of 1/60 s.
// Setting up and the first seconds are not timed. Each row carries its witnesses: energy drift,
// deepest overlap, hash of the state, and whether the hash is that of the same run with one thread.
#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <ctime>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ball_sim/fill.hpp"
#include "ball_sim/methods.hpp"
#include "ball_sim/observables.hpp"

namespace ball_sim::core {
namespace {

constexpr double kFrame = 1.0 / 60;  // s
constexpr int kWarmUp = 30;          // frames

struct Gas {
  Surroundings surroundings;
  std::vector<Ball> balls;
};

/// The gas of so many balls, made once.
const Gas& gasOf(std::size_t count) {
  static std::map<std::size_t, Gas> made;
  const auto found = made.find(count);
  if (found != made.end()) return found->second;
  Scene scene;
  Fill fill;
  fill.count = count;
  fill.radius = {0.05, 0.05};
  fill.mass = Range{1, 1};
  fill.speed_sigma = 1;
  fill.seed = 1;
  fill.packing_fraction = 0.1;
  scene.fill = {fill};
  Gas& gas = made[count];
  gas.balls = populate(scene);
  gas.surroundings = scene.surroundings;
  return gas;
}

double cpuSeconds() {
  timespec time = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Row {
  std::string method;
  unsigned threads;
  std::size_t count;
  int frames;  // measured
};

/// Hashes of the runs so far: those of one method, number of balls and time must be the same.
std::map<std::string, std::uint64_t> hashes;

void measure(benchmark::State& state, const Row& row) {
  const Gas& gas = gasOf(row.count);
  MethodSettings settings;
  settings.threads = row.threads;
  const auto method = makeMethod(row.method, gas.surroundings, settings);
  std::vector<double> masses;
  for (std::size_t i = 0; i < gas.balls.size(); ++i) {
    method->insert(static_cast<BallId>(i), gas.balls[i]);
    masses.push_back(gas.balls[i].mass);
  }
  BallStates states;
  method->read(states);
  const double energy_before = kineticEnergy(states, masses);
  int frame = 0;
  const auto advance = [&] { method->advanceTo(Time::fromSeconds(++frame * kFrame)); };
  while (frame < kWarmUp) advance();

  const Statistics before = method->statistics();
  double cpu = 0;
  double wall = 0;
  for (auto _ : state) {
    const double cpu_start = cpuSeconds();
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < row.frames; ++i) advance();
    wall += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    cpu += cpuSeconds() - cpu_start;
  }
  const Statistics after = method->statistics();
  method->read(states);
  const double simulated = (frame - kWarmUp) * kFrame;
  const auto collisions = double(after.ball_collisions - before.ball_collisions);
  state.counters["cpu s/s"] = cpu / simulated;
  state.counters["wall s/s"] = wall / simulated;
  state.counters["coll/cpu s"] = collisions / cpu;
  state.counters["coll/ball s"] = 2 * collisions / double(row.count) / simulated;
  state.counters["bytes/ball"] = double(after.bytes) / double(row.count);
  state.counters["drift"] = kineticEnergy(states, masses) / energy_before - 1;
  state.counters["overlap"] = after.deepest_overlap;
  const std::uint64_t hash = stateHash(states);
  const auto first =
      hashes.emplace(row.method + std::to_string(row.count) + "/" + std::to_string(frame), hash);
  state.SetLabel("hash " + std::to_string(hash) +
                 (first.first->second == hash ? "" : " DIFFERS from that of one thread"));
}

}  // namespace
}  // namespace ball_sim::core

int main(int argc, char** argv) {
  using namespace ball_sim::core;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  for (int exponent = 3; exponent <= 6; ++exponent) {
    const auto count = static_cast<std::size_t>(std::pow(10, exponent));
    const int frames = exponent < 5 ? 60 : (exponent == 5 ? 20 : 6);
    for (const Row& row :
         {Row{"event_driven", 1, count, frames}, Row{"continuous", 1, count, frames},
          Row{"continuous", 2, count, frames}}) {
      const std::string name = "gas/1e" + std::to_string(exponent) + "/" + row.method + "/" +
                               std::to_string(row.threads);
      benchmark::RegisterBenchmark(name.c_str(), measure, row)
          ->Unit(benchmark::kMillisecond)
          ->Iterations(exponent == 3 ? 10 : (exponent == 4 ? 2 : 1));
    }
  }
  benchmark::RunSpecifiedBenchmarks();
}
