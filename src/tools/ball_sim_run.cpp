// ball_sim_run: runs a scene as fast as it can, without ROS, and writes what happened.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <exception>
#include <optional>

#include "ball_sim/scene_reader.hpp"
#include "ball_sim/text.hpp"
#include "ball_sim/warnings.hpp"
#include "ball_sim/world.hpp"
#include "csv_files.hpp"
#include "progress_bar.hpp"
#include "run_options.hpp"
#include "run_statistics.hpp"

namespace ball_sim::core {
namespace {

constexpr int kDone = 0;
constexpr int kBadInput = 2;
constexpr int kCouldNotGoOn = 3;

// Between two looks at the clock, the keyboard and the impacts: at least, at most.
constexpr std::uint64_t kFewestEvents = 64;
constexpr std::uint64_t kMostEvents = 65536;
constexpr double kLookEvery = 0.02;  // s of wall-clock time

// All balls may meet at one instant, and some of them again and again; but not this often.
constexpr std::uint64_t kMostEventsAtOnce = 10'000'000;
constexpr std::uint64_t kMostEventsAtOncePerBall = 100;

volatile std::sig_atomic_t interrupted = 0;
extern "C" void onSignal(int) { interrupted = 1; }

/// A run that cannot go on; what() tells why.
class RunError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

double cpuSeconds() {
  timespec time = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// The files asked for, opened before the run so that none is found unwritable after it.
struct Outputs {
  std::optional<StatesFile> states;
  std::optional<EventsFile> events;
  std::optional<OutputFile> stats;

  explicit Outputs(const RunOptions& options) {
    if (!options.out.empty()) states.emplace(options.out);
    if (!options.events.empty()) events.emplace(options.events);
    if (!options.stats.empty()) stats.emplace(options.stats);
  }
};

/// Advances a world, looking after clock, impacts, progress and standstill on the way.
class Runner {
 public:
  Runner(World& world, const RunOptions& options, Outputs& outputs)
      : world_(world), options_(options), outputs_(outputs), bar_(options.until, options.progress) {
    record_.until = options.until;
    record_.before = conservedIn(world);
    if (outputs.events) world.setCollisionLog(&log_);
  }

  /// Runs to the end, or as far as it goes.
  const RunRecord& run() {
    try {
      writeStates();
      // The k-th instant is k * every, not a sum of steps: no rounding piles up.
      for (std::uint64_t k = 1;
           options_.every && static_cast<double>(k) * *options_.every < options_.until; ++k) {
        advanceTo(Time::fromSeconds(static_cast<double>(k) * *options_.every));
        writeStates();
      }
      advanceTo(Time::fromSeconds(options_.until));
    } catch (const std::exception& error) {
      record_.error = error.what();
    }
    bar_.finish(world_.now().seconds());
    return record_;
  }

  void writeStates() {
    if (!outputs_.states) return;
    world_.read(states_);
    outputs_.states->add(states_);
  }

 private:
  void advanceTo(Time target) {
    bool reached = false;
    while (!reached) {
      reached = advanceABit(target);
      if (outputs_.events) outputs_.events->take(log_);
      bar_.show(world_.now().seconds());
      if (interrupted != 0) throw RunError("interrupted");
      if (!reached) demandProgress();
    }
  }

  bool advanceABit(Time target) {
    const auto wall_start = std::chrono::steady_clock::now();
    const double cpu_start = cpuSeconds();
    const bool reached = world_.advanceTo(target, chunk_);
    const double cpu = cpuSeconds() - cpu_start;
    const double wall =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_start).count();
    record_.cpu_seconds += cpu;
    record_.wall_seconds += wall;
    if (!reached) {
      chunk_ = wall < kLookEvery ? std::min(2 * chunk_, kMostEvents)
                                 : std::max(chunk_ / 2, kFewestEvents);
    }
    return reached;
  }

  // Simulated time must move on, however slowly.
  void demandProgress() {
    const std::uint64_t events = world_.statistics().events;
    if (world_.now() != last_time_) {
      last_time_ = world_.now();
      events_then_ = events;
    } else if (events - events_then_ >
               kMostEventsAtOnce + kMostEventsAtOncePerBall * world_.size()) {
      throw RunError("time stands still at " + formatNumber(last_time_.seconds()) +
                     " s: " + std::to_string(events - events_then_) + " events at one instant");
    }
  }

  World& world_;
  const RunOptions& options_;
  Outputs& outputs_;
  ProgressBar bar_;
  RunRecord record_;
  CollisionLog log_;
  BallStates states_;
  std::uint64_t chunk_ = kFewestEvents;
  Time last_time_;
  std::uint64_t events_then_ = 0;
};

void printSummary(const World& world, const RunRecord& record) {
  const Statistics counted = world.statistics();
  std::printf(
      "%zu balls, %s s simulated in %.3g s by %s (%s)\n"
      "%llu ball collisions, %llu wall collisions, energy drift %.3g, deepest overlap %.3g m\n",
      world.size(), formatNumber(world.now().seconds()).c_str(), record.wall_seconds,
      world.method().name.c_str(), world.method().reason.c_str(),
      static_cast<unsigned long long>(counted.ball_collisions),
      static_cast<unsigned long long>(counted.wall_collisions),
      energyDrift(record.before, conservedIn(world)), counted.deepest_overlap);
}

void warn(const std::string& text) {
  if (!text.empty()) std::fprintf(stderr, "ball_sim_run: warning: %s\n", text.c_str());
}

int runScene(const RunOptions& options) {
  WorldOptions world_options;
  world_options.method = options.method;
  world_options.time_step = options.time_step;
  world_options.precision = options.precision;
  world_options.threads = options.threads;
  const Scene scene = readScene(options.scene);
  World world(scene, world_options);
  Outputs outputs(options);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);

  Runner runner(world, options, outputs);
  RunRecord record = runner.run();
  try {
    runner.writeStates();
    if (outputs.stats) {
      outputs.stats->write(statisticsJson(world, record));
      outputs.stats->flush();
    }
  } catch (const OutputError& error) {
    if (record.error.empty()) record.error = error.what();
  }
  world.setCollisionLog(nullptr);
  warn(policyWarning(world));
  warn(world.warning());
  if (!record.error.empty()) {
    std::fprintf(stderr, "ball_sim_run: could not go on at %s s: %s\n",
                 formatNumber(world.now().seconds()).c_str(), record.error.c_str());
    return kCouldNotGoOn;
  }
  printSummary(world, record);
  return kDone;
}

int runProgram(int argc, const char* const* argv) {
  try {
    const RunOptions options = parseArguments(argc, argv);
    if (options.help) {
      std::fputs(helpText().c_str(), stdout);
      return kDone;
    }
    if (options.version) {
      std::puts("ball_sim_run " BALL_SIM_VERSION);
      return kDone;
    }
    return runScene(options);
  } catch (const ArgumentError& error) {
    std::fprintf(stderr, "ball_sim_run: %s (--help tells more)\n", error.what());
  } catch (const std::bad_alloc&) {
    std::fputs("ball_sim_run: not enough memory for this scene\n", stderr);
  } catch (const std::exception& error) {  // the scene, a fill, a ball, an output
    std::fprintf(stderr, "ball_sim_run: %s\n", error.what());
  }
  return kBadInput;
}

}  // namespace
}  // namespace ball_sim::core

int main(int argc, char** argv) { return ball_sim::core::runProgram(argc, argv); }
