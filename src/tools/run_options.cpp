// The command line of ball_sim_run.
#include "run_options.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <vector>

#include "ball_sim/limits.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim::core {
namespace {

// More states than that would fill any disk: the step is a slip.
constexpr double kMostStates = 1e9;

constexpr double kMostThreads = 1024;  // more is a slip too

[[noreturn]] void refuse(const std::string& argument, const std::string& value,
                         const std::string& rule) {
  throw ArgumentError(argument + ": " + (value.empty() ? "''" : value) + ": " + rule);
}

double seconds(const std::string& argument, const std::string& value) {
  const std::optional<double> number = parseDecimal(value);
  if (!number || !(*number > 0) || *number > kMaxTime) {
    refuse(argument, value,
           "must be a number of seconds above 0, at most " + formatNumber(kMaxTime));
  }
  return *number;
}

std::string path(const std::string& argument, const std::string& value) {
  if (value.empty()) refuse(argument, value, "must be the path of a file");
  return value;
}

std::string methodName(const std::string& argument, const std::string& value) {
  const std::vector<std::string>& names = methodNames();
  if (std::find(names.begin(), names.end(), value) == names.end()) {
    refuse(argument, value, "must be one of " + formatList(names));
  }
  return value;
}

Precision precisionOf(const std::string& argument, const std::string& value) {
  if (value == "double") return Precision::double_precision;
  if (value == "long_double") return Precision::long_double;
  refuse(argument, value, "must be double or long_double");
}

unsigned threadCount(const std::string& argument, const std::string& value) {
  const std::optional<double> number = parseDecimal(value);
  if (!number || !(*number >= 1) || *number > kMostThreads || *number != std::floor(*number)) {
    refuse(argument, value, "must be a whole number of threads, 1.." + formatNumber(kMostThreads));
  }
  return static_cast<unsigned>(*number);
}

using Setter = std::function<void(RunOptions&, const std::string& argument, const std::string&)>;

// Options that take a value.
const std::map<std::string, Setter>& setters() {
  using Text = const std::string&;
  static const std::map<std::string, Setter> all = {
      {"--until", [](RunOptions& o, Text a, Text v) { o.until = seconds(a, v); }},
      {"--method", [](RunOptions& o, Text a, Text v) { o.method = methodName(a, v); }},
      {"--time-step", [](RunOptions& o, Text a, Text v) { o.time_step = seconds(a, v); }},
      {"--every", [](RunOptions& o, Text a, Text v) { o.every = seconds(a, v); }},
      {"--out", [](RunOptions& o, Text a, Text v) { o.out = path(a, v); }},
      {"--events", [](RunOptions& o, Text a, Text v) { o.events = path(a, v); }},
      {"--stats", [](RunOptions& o, Text a, Text v) { o.stats = path(a, v); }},
      {"--precision", [](RunOptions& o, Text a, Text v) { o.precision = precisionOf(a, v); }},
      {"--threads", [](RunOptions& o, Text a, Text v) { o.threads = threadCount(a, v); }},
  };
  return all;
}

// Options that take none.
const std::map<std::string, bool RunOptions::*>& switches() {
  static const std::map<std::string, bool RunOptions::*> all = {
      {"--help", &RunOptions::help},
      {"-h", &RunOptions::help},
      {"--version", &RunOptions::version},
      {"--progress", &RunOptions::progress},
  };
  return all;
}

[[noreturn]] void refuseUnknown(const std::string& argument) {
  std::vector<std::string> known;
  for (const auto& setter : setters()) known.push_back(setter.first);
  for (const auto& one : switches()) known.push_back(one.first);
  refuse(argument, "unknown", "must be one of " + formatList(known));
}

void checkTogether(const RunOptions& options) {
  if (options.scene.empty()) refuse("SCENE.yaml", "missing", "the path of a scene is required");
  if (options.until == 0) refuse("--until", "missing", "the time to run to, in s, is required");
  if (options.every && options.until / *options.every > kMostStates) {
    refuse("--every", formatNumber(*options.every),
           "must not ask for more than " + formatNumber(kMostStates) + " states");
  }
  if (options.every && options.out.empty()) {
    refuse("--every", formatNumber(*options.every), "needs --out, the file to write to");
  }
  // One file must not be written over by another.
  const std::vector<std::pair<std::string, std::string>> files = {{"SCENE.yaml", options.scene},
                                                                  {"--out", options.out},
                                                                  {"--events", options.events},
                                                                  {"--stats", options.stats}};
  const auto resolved = [](const std::string& name) {
    std::error_code error;
    const auto whole = std::filesystem::weakly_canonical(name, error);
    return error ? std::filesystem::path(name) : whole;
  };
  for (std::size_t i = 0; i < files.size(); ++i) {
    for (std::size_t j = i + 1; j < files.size(); ++j) {
      if (files[j].second.empty() || resolved(files[i].second) != resolved(files[j].second)) {
        continue;
      }
      std::error_code error;  // a device such as /dev/null may serve twice
      if (std::filesystem::is_character_file(files[j].second, error)) continue;
      refuse(files[j].first, files[j].second, "must not be the file given as " + files[i].first);
    }
  }
}

}  // namespace

RunOptions parseArguments(int argc, const char* const* argv) {
  RunOptions options;
  std::set<std::string> seen;
  bool options_ended = false;  // by a lone --
  for (int i = 1; i < argc; ++i) {
    std::string argument = argv[i];
    if (options_ended || argument.empty() || argument[0] != '-') {
      if (!options.scene.empty()) refuse("SCENE.yaml", argument, "only one scene can be given");
      options.scene = path("SCENE.yaml", argument);
      continue;
    }
    if (argument == "--") {
      options_ended = true;
      continue;
    }
    const std::size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    if (!seen.insert(name).second) refuse(name, "repeated", "must be given once");
    const auto one = switches().find(name);
    if (one != switches().end() && equals == std::string::npos) {
      options.*(one->second) = true;
      continue;
    }
    const auto setter = setters().find(name);
    if (setter == setters().end()) refuseUnknown(argument);
    if (equals == std::string::npos && i + 1 >= argc) {
      refuse(name, "missing", "must be followed by a value");
    }
    const std::string value = equals == std::string::npos ? argv[++i] : argument.substr(equals + 1);
    setter->second(options, name, value);
  }
  if (!options.help && !options.version) checkTogether(options);
  return options;
}

std::string helpText() {
  return "Runs a scene of colliding balls as fast as it can, without ROS.\n"
         "\n"
         "  ball_sim_run SCENE.yaml --until T [options]\n"
         "\n"
         "  --until T            simulated time to run to, s; required, above 0\n"
         "  --method M           overrides the scene's method: " +
         formatList(methodNames()) +
         "\n"
         "  --time-step DT       overrides the scene's time_step, s (stepping methods)\n"
         "  --out FILE           writes states as CSV: time,id,x,y,z,vx,vy,vz (s, m, m/s), with "
         "17\n"
         "                       digits; ids count from 0: the scene's balls, then each fill's\n"
         "  --every DT           states at 0, DT, 2 DT, ... s and at the end; without it: at the\n"
         "                       start and at the end only\n"
         "  --events FILE        writes every impact as CSV: time,a,b,nx,ny,nz,impulse (s, ids, "
         "unit\n"
         "                       normal from a towards b, N s); b < 0 is a wall: -1 x-min, -2 "
         "x-max,\n"
         "                       -3 y-min, -4 y-max, -5 z-min, -6 z-max face of the box, -7 - k\n"
         "                       plane k of the scene, k from 0\n"
         "  --stats FILE         writes statistics of the run as JSON\n"
         "  --precision P        arithmetic of the method: double (default) or long_double, "
         "slower\n"
         "  --threads N          threads to share the work among, by methods that can "
         "(continuous); 1\n"
         "                       unless given. No bit of the result depends on it\n"
         "  --progress           shows progress on stderr even where that is no terminal\n"
         "  --version            prints the version\n"
         "  --help, -h           prints this\n"
         "\n"
         "Files that exist are overwritten, once arguments and scene are found good.\n"
         "\n"
         "Statistics: balls; until (s); reached (s, = until unless the run ended early); method;\n"
         "method_reason; ball_collisions; wall_collisions; events (all that the method handled,\n"
         "cell crossings and the like included); wall_seconds and cpu_seconds (of the run, "
         "without\n"
         "set-up and output); kinetic_energy_before and _after (J); energy_drift (change of "
         "kinetic\n"
         "and potential energy, relative to what there was before); momentum_before and _after\n"
         "(kg m/s); deepest_overlap (m, seen at any impact); ambiguous_impacts (whose outcome\n"
         "simultaneous_impacts decides); compressibility (P V / N k T by the\n"
         "virial; null unless the box is periodic, restitution is 1, and balls that are all free\n"
         "move); bytes_per_ball; state_hash (of ids, places and velocities at the end); error\n"
         "(why the run ended early; null when it did not).\n"
         "\n"
         "Exit codes: 0 done; 2 bad arguments or scene; 3 the run could not go on: the reason is "
         "on\n"
         "stderr, and the files hold what was reached.\n";
}

}  // namespace ball_sim::core
