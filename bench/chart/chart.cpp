// Measures speed against accuracy: every scene of the chart by every method, and by other engines
// where they are built in. Writes one row a run; draw_chart.py makes the figures of them.
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "ball_sim/random_source.hpp"
#include "isolation.hpp"
#include "measurement.hpp"
#ifdef BALL_SIM_BENCH_PEERS
#include "peers.hpp"
#endif

namespace ball_sim::core::chart {
namespace {

constexpr int kFinest = 14;  // the shortest step is R/v 2^-kFinest
constexpr int kPhases = 20;  // one fixed phase would hide an error of first order
constexpr int kFewestPhases = 3;
constexpr std::size_t kMany = 200;     // balls: their steps are dear, and may take
constexpr double kManyFold = 5;        // so many times as long
constexpr double kLongestExact = 25;   // s of CPU time, for all runs of an entrant without a step
constexpr double kLongestSweep = 120;  // s by the clock: then an entrant's finer steps are given up

struct Options {
  std::string source = BALL_SIM_SOURCE_DIR;
  std::string out;
  std::string only;  // scene
  bool quick = false;
  bool peers = true;
};

/// How much is measured.
struct Effort {
  double path_budget = 0.25;       // s of CPU time for one step length, by the fixed cost
  double statistics_budget = 0.6;  // s, likewise
  double longest = 6;              // s of CPU time, for one step length by one entrant
  double exact_budget = 4;         // s by the clock, for the repeats of an exact run
  int stride = 1;                  // of k
  int phases = kPhases;
};

Effort effortOf(const Options& options) {
  if (!options.quick) return {};
  return {0.02, 0.1, 4, 1, 3, 5};
}

/// A scene with all that is known about it.
struct Case {
  PreparedScene scene;
  Trajectory truth;
  TrueStatistics statistics;
};

Case prepareCase(const ScenePlan& plan, const Options& options) {
  Case made;
  made.scene = prepare(plan, options.source);
  made.truth = trueTrajectory(made.scene, plan.horizon);
  made.statistics = trueStatistics(made.scene);
  return made;
}

using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// One line that says how far it is.
class Progress {
 public:
  void show(double share, const std::string& what) {
    const auto full = static_cast<std::size_t>(share * 30);
    const std::string bar = std::string(full, '=') + std::string(30 - full, ' ');
    const double seconds = secondsSince(start_);
    std::fprintf(stderr, "%s[%s] %3.0f %%  %4.0f s  %s%s", terminal_ ? "\r" : "", bar.c_str(),
                 100 * share, seconds, what.c_str(), terminal_ ? "\033[K" : "\n");
    if (terminal_ && share >= 1) std::fputc('\n', stderr);
  }

 private:
  Clock::time_point start_ = Clock::now();
  bool terminal_ = isatty(STDERR_FILENO) == 1;
};

class Report {
 public:
  Report(const Options& options) : options_(options), effort_(effortOf(options)) {
    file_.open(options.out);
    if (!file_) throw std::runtime_error(options.out + ": cannot be written");
    file_ << csvHeader() << "\n";
    entrants_ = ownMethods();
#ifdef BALL_SIM_BENCH_PEERS
    if (options.peers) {
      for (const Entrant& peer : peers()) entrants_.push_back(peer);
    }
#endif
  }

  void run() {
    std::vector<ScenePlan> plans;
    for (const ScenePlan& plan : scenePlans()) {
      if (options_.only.empty() || options_.only == plan.name) plans.push_back(plan);
    }
    if (plans.empty()) throw std::runtime_error("no scene is named " + options_.only);
    prepareAll(plans);
    for (std::size_t i = 0; i < cases_.size(); ++i) {
      for (std::size_t j = 0; j < entrants_.size(); ++j) {
        const double done = static_cast<double>(i * entrants_.size() + j) /
                            static_cast<double>(cases_.size() * entrants_.size());
        progress_.show(kTruthShare + (1 - kTruthShare) * done,
                       cases_[i].scene.plan.name + ": " + entrants_[j].name);
        measure(cases_[i], entrants_[j]);
      }
    }
    progress_.show(1, "measured");
  }

 private:
  static constexpr double kTruthShare = 0.1;  // of the whole time, roughly

  // The truths are not timed, so they may share the machine.
  void prepareAll(const std::vector<ScenePlan>& plans) {
    cases_.resize(plans.size());
    std::atomic<std::size_t> next{0};
    std::vector<std::thread> workers;
    for (unsigned i = 0; i < std::max(1u, std::thread::hardware_concurrency()); ++i) {
      workers.emplace_back([&] {
        for (std::size_t mine; (mine = next++) < plans.size();) {
          cases_[mine] = prepareCase(plans[mine], options_);
        }
      });
    }
    progress_.show(0, "computing the truth in 256 bits");
    for (std::thread& worker : workers) worker.join();
  }

  void measure(const Case& one, const Entrant& entrant) {
    const std::string refusal = entrant.refusal(one.scene);
    if (!refusal.empty()) {
      write(failed(one, entrant, -1, "left out: " + refusal));
    } else if (entrant.kind == Kind::exact) {
      isolated(one, entrant, 0, kLongestExact,
               [&](const Sink& sink) { exactRuns(one, entrant, sink); });
    } else {
      sweep(one, entrant);
    }
  }

  void sweep(const Case& one, const Entrant& entrant) {
    const Clock::time_point start = Clock::now();
    for (int k = 0; k <= kFinest; k += effort_.stride) {
      if (secondsSince(start) > kLongestSweep) {
        write(failed(one, entrant, k, "given up: longer steps took too long"));
      } else {
        isolated(one, entrant, k, effort_.longest,
                 [&](const Sink& sink) { steppedRuns(one, entrant, k, sink); });
      }
    }
  }

  // A row that tells why there is none. k: of the step, or -1.
  static Row failed(const Case& one, const Entrant& entrant, int k, const std::string& why) {
    Row row;
    row.scene = one.scene.plan.name;
    row.entrant = entrant.name;
    row.kind = entrant.kind;
    row.balls = one.scene.balls.size();
    row.exponent = k;
    if (k >= 0) row.step = stepOf(one, k);
    row.failure = why;
    return row;
  }

  using Sink = std::function<void(const Row&)>;

  void isolated(const Case& one, const Entrant& entrant, int k, double longest,
                const std::function<void(const Sink&)>& work) {
    const Outcome outcome = runIsolated(
        [&](const std::function<void(const std::string&)>& give) {
          work([&](const Row& row) { give(csvLine(row)); });
        },
        longest);
    for (const std::string& line : outcome.lines) file_ << line << "\n";
    if (!outcome.failure.empty()) write(failed(one, entrant, k, outcome.failure));
    file_.flush();
  }

  static double stepOf(const Case& one, int k) {
    return std::ldexp(one.scene.reach / one.scene.plan.speed, -k);
  }

  // Always the same run: as often as the median of its time is worth.
  void exactRuns(const Case& one, const Entrant& entrant, const Sink& sink) const {
    const double step = one.scene.plan.horizon / 200;
    const Clock::time_point start = Clock::now();
    const auto once = [&] {
      return measurePath(one.scene, one.truth, one.scene.plan.horizon, entrant, step, 0);
    };
    once();  // warms up
    for (int i = 0; i < std::min(one.scene.plan.repeats, effort_.phases); ++i) {
      if (i >= kFewestPhases && secondsSince(start) > effort_.exact_budget) break;
      sink(once());
    }
    if (one.scene.plan.statistics > 0 && entrant.name != "brute_force") {  // it takes too long
      sink(measureStatistics(one.scene, one.statistics, one.scene.plan.statistics, entrant,
                             one.scene.plan.statistics));
    }
  }

  void steppedRuns(const Case& one, const Entrant& entrant, int k, const Sink& sink) const {
    const double step = stepOf(one, k);
    const double per_second =
        entrant.cost * 1e-9 * static_cast<double>(one.scene.balls.size()) / step;
    const double setup = entrant.setup_cost * static_cast<double>(one.scene.balls.size());
    const double one_path =
        2 * (per_second * one.scene.plan.horizon + setup);  // timed, and looked at
    const double budget = effort_.path_budget * (one.scene.balls.size() > kMany ? kManyFold : 1);
    const int affordable = static_cast<int>(std::min(budget / one_path, 1e6));
    const int phases = std::min({effort_.phases, affordable, one.scene.plan.repeats});
    if (one.scene.plan.horizon / step >= 4 && phases >= kFewestPhases) {
      RandomSource random(static_cast<std::uint64_t>(k) + 1);
      measurePath(one.scene, one.truth, one.scene.plan.horizon, entrant, step, 0);  // warms up
      for (int i = 0; i < phases; ++i) {
        Row row = measurePath(one.scene, one.truth, one.scene.plan.horizon, entrant, step,
                              random.uniform());
        row.exponent = k;
        sink(row);
      }
    }
    const double duration = one.scene.plan.statistics;
    if (duration > 0 && duration / step >= 4 &&
        per_second * duration <= effort_.statistics_budget) {
      Row row = measureStatistics(one.scene, one.statistics, duration, entrant, step);
      row.exponent = k;
      sink(row);
    }
  }

  void write(const Row& row) { file_ << csvLine(row) << "\n"; }

  Options options_;
  Effort effort_;
  std::ofstream file_;
  std::vector<Entrant> entrants_;
  std::vector<Case> cases_;
  Progress progress_;
};

void writeScenes(const std::string& path) {
  std::ofstream file(path);
  file << "scene,question,horizon,statistics,truth\n";
  for (const ScenePlan& plan : scenePlans()) {
    file << plan.name << ",\"" << plan.question << "\"," << plan.horizon << "," << plan.statistics
         << ",\"" << nameOf(plan.truth) << "\"\n";
  }
}

int usage() {
  std::fputs(
      "usage: ball_sim_chart --out FILE.csv [--scenes FILE.csv] [--only SCENE] [--quick]"
      " [--no-peers]\n",
      stderr);
  return 2;
}

int runMain(int argc, char** argv) {
  Options options;
  std::string scenes;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--quick") {
      options.quick = true;
    } else if (argument == "--no-peers") {
      options.peers = false;
    } else if (i + 1 < argc && argument == "--out") {
      options.out = argv[++i];
    } else if (i + 1 < argc && argument == "--scenes") {
      scenes = argv[++i];
    } else if (i + 1 < argc && argument == "--only") {
      options.only = argv[++i];
    } else {
      return usage();
    }
  }
  if (options.out.empty()) return usage();
  if (!scenes.empty()) writeScenes(scenes);
  Report(options).run();
  return 0;
}

}  // namespace
}  // namespace ball_sim::core::chart

int main(int argc, char** argv) {
  try {
    return ball_sim::core::chart::runMain(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
}
