// Measures one run.
#include "measurement.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <iterator>

#include "ball_sim/methods.hpp"
#include "ball_sim/observables.hpp"
#include "state_check.hpp"

namespace ball_sim::core::chart {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kValid = 0.01;           // of R: as far as a path counts as right
constexpr std::uint64_t kLooks = 200;     // at a run, to find when it goes wrong
constexpr std::uint64_t kDeepLooks = 20;  // at the overlaps of many balls
constexpr std::size_t kMany = 200;        // balls

// Of this thread: no entrant has others. The clock of the process is coarse under a CPU limit.
double cpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

const char* nameOf(Kind kind) {
  switch (kind) {
    case Kind::exact:
      return "exact";
    case Kind::stepped:
      return "stepped";
    case Kind::peer:
      break;
  }
  return "peer";
}

Row startRow(Part part, const PreparedScene& scene, const Entrant& entrant, double step) {
  Row row;
  row.part = part;
  row.scene = scene.plan.name;
  row.entrant = entrant.name;
  row.kind = entrant.kind;
  row.step = step;
  row.balls = scene.balls.size();
  return row;
}

std::vector<Ball> ballsAt(const PreparedScene& scene, const Trajectory& truth, double date) {
  std::vector<Ball> balls = scene.balls;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const Trajectory::State state = truth.at(static_cast<BallId>(i), date);
    balls[i].position = state.position;
    balls[i].velocity = state.velocity;
  }
  return balls;
}

// CPU time of one run. Short runs are timed several together, set up beforehand.
double timeRun(const PreparedScene& scene, const Entrant& entrant, const std::vector<Ball>& balls,
               double step, std::uint64_t steps) {
  const double size = static_cast<double>(steps) * static_cast<double>(balls.size());
  const bool is_short =
      entrant.kind == Kind::exact ? balls.size() <= 20 && scene.plan.repeats >= 20 : size < 1000;
  const int many = entrant.kind == Kind::peer ? 4 : 16;  // an engine's set-up may take long
  const int copies = is_short ? many : 1;
  std::vector<std::unique_ptr<Simulation>> runs;
  for (int i = 0; i < copies; ++i) {
    runs.push_back(entrant.make(scene.surroundings, balls, step));
  }
  const double begin = cpuSeconds();
  for (const auto& run : runs) run->advance(steps);
  return (cpuSeconds() - begin) / static_cast<double>(runs.size());
}

// How many of the first sorted list's entries the second lacks; both may repeat entries.
std::size_t lacking(const std::vector<Impact>& wanted, const std::vector<Impact>& there) {
  std::vector<Impact> rest;
  std::set_difference(wanted.begin(), wanted.end(), there.begin(), there.end(),
                      std::back_inserter(rest));
  return rest.size();
}

void compareImpacts(Row& row, const std::vector<Impact>& wanted, std::vector<Impact> there) {
  std::sort(there.begin(), there.end());
  row.true_impacts = wanted.size();
  row.impacts = there.size();
  if (wanted.empty()) return;
  const auto all = static_cast<double>(wanted.size());
  row.missed = static_cast<double>(lacking(wanted, there)) / all;
  row.extra = static_cast<double>(lacking(there, wanted)) / all;
}

double momentumScale(const PreparedScene& scene) {
  double scale = 0;
  for (const Ball& ball : scene.balls) scale += ball.mass * ball.velocity.norm();
  return scale;
}

// The run again, untimed, looked at on the way.
void witnessPath(Row& row, const PreparedScene& scene, const Trajectory& truth,
                 const Entrant& entrant, const std::vector<Ball>& balls) {
  const double begin = row.phase * row.step;
  const double true_energy = energyOf(scene, statesAt(truth, begin));
  const auto run = entrant.make(scene.surroundings, balls, row.step);
  const std::uint64_t stride = std::max<std::uint64_t>(row.steps / kLooks, 1);
  const std::uint64_t deep_stride =
      scene.balls.size() > kMany ? std::max<std::uint64_t>(row.steps / kDeepLooks, 1) : stride;
  double overlap = 0;
  double date = begin;
  double last_right = begin;
  BallStates states;
  std::vector<Impact> impacts;
  run->takeImpacts(impacts);
  for (std::uint64_t step = 1; step <= row.steps; ++step) {
    run->advance(1);
    run->takeImpacts(impacts);
    const bool last = step == row.steps;
    if (step % stride != 0 && !last) continue;
    date = begin + static_cast<double>(step) * row.step;
    run->read(states);
    row.failure = defect(scene, states, true_energy);
    if (!row.failure.empty()) break;
    row.error = largestError(scene, truth, date, states) / scene.reach;
    if (*row.error > kValid && !row.valid_time) row.valid_time = last_right - begin;
    last_right = date;
    if (step % deep_stride == 0 || last) {
      overlap = std::max(overlap, deepestOverlap(scene, states));
    }
  }
  row.valid_to_end = !row.valid_time;
  if (row.valid_to_end) row.valid_time = date - begin;
  if (!row.failure.empty()) row.error.reset();
  row.overlap = std::max(overlap, run->work().deepest_overlap) / scene.reach;
  row.events = run->work().events;
  if (row.failure.empty()) {
    const double expected = energyOf(scene, statesAt(truth, date));
    row.energy_error = std::abs(energyOf(scene, states) - expected) / true_energy;
    compareImpacts(row, truth.impactsWithin(begin, date), std::move(impacts));
  }
  if (row.failure.empty() && conservesMomentum(scene)) {
    const std::vector<double> masses = massesOf(scene);
    const Vector3 change = momentum(states, masses) - momentum(statesAt(truth, begin), masses);
    row.momentum_error = change.norm() / momentumScale(scene);
  }
}

double squareSum(const std::vector<Ball>& balls) {
  double sum = 0;
  for (const Ball& ball : balls) sum += ball.mass * dot(ball.velocity, ball.velocity);
  return sum;
}

// k T of the balls' motion about their common one, J.
double temperature(const PreparedScene& scene) {
  Vector3 total = Vector3::Zero();
  double mass = 0;
  for (const Ball& ball : scene.balls) {
    total += ball.mass * ball.velocity;
    mass += ball.mass;
  }
  const double freedoms = (scene.planar() ? 2 : 3) * static_cast<double>(scene.balls.size() - 1);
  return (squareSum(scene.balls) - dot(total, total) / mass) / freedoms;
}

// Z of hard spheres. Source: Carnahan, Starling, "Equation of state for nonattracting rigid
// spheres", 1969; good to about 0.3 %.
double carnahanStarling(double eta) {
  return (1 + eta + eta * eta - eta * eta * eta) / std::pow(1 - eta, 3);
}

double packingFraction(const PreparedScene& scene) {
  const Vector3 edge = scene.surroundings.box.max - scene.surroundings.box.min;
  double volume = 0;
  for (const Ball& ball : scene.balls) volume += 4.0 / 3 * kPi * std::pow(ball.radius, 3);
  return volume / edge.prod();
}

// Ten times longer than an entrant's run, in another arithmetic.
TrueStatistics longRun(const PreparedScene& scene) {
  MethodSettings settings;
  settings.precision = Precision::long_double;
  const auto method = makeMethod("event_driven", scene.surroundings, settings);
  for (std::size_t i = 0; i < scene.balls.size(); ++i) {
    method->insert(static_cast<BallId>(i), scene.balls[i]);
  }
  const double duration = 10 * scene.plan.statistics;
  method->advanceTo(Time::fromSeconds(duration));
  const auto collisions = static_cast<double>(method->statistics().ball_collisions);
  return {2 * collisions / static_cast<double>(scene.balls.size()) / duration, std::nullopt};
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string field(const std::optional<double>& value) { return value ? number(*value) : ""; }
std::string field(const std::optional<std::uint64_t>& value) {
  return value ? std::to_string(*value) : "";
}

}  // namespace

TrueStatistics trueStatistics(const PreparedScene& scene) {
  if (scene.plan.statistics == 0) return {};
  if (!scene.surroundings.periodic) return longRun(scene);
  const double z = carnahanStarling(packingFraction(scene));
  const double thermal_speed = std::sqrt(temperature(scene) / scene.balls[0].mass);
  // Z - 1 = Gamma sigma sqrt(pi m/kT)/6, at any density.
  const double rate = (z - 1) * 6 * thermal_speed / (scene.reach * std::sqrt(kPi));
  return {rate, z};
}

Row measurePath(const PreparedScene& scene, const Trajectory& truth, double horizon,
                const Entrant& entrant, double step, double phase) {
  Row row = startRow(Part::path, scene, entrant, step);
  row.phase = phase;
  // Rounding must not take away a last step that ends at the horizon.
  row.steps = static_cast<std::uint64_t>((horizon - phase * step) / step + 1e-9);
  row.simulated = static_cast<double>(row.steps) * step;
  const std::vector<Ball> balls = ballsAt(scene, truth, phase * step);
  try {
    row.cpu = timeRun(scene, entrant, balls, step, row.steps);
    witnessPath(row, scene, truth, entrant, balls);
  } catch (const std::exception& error) {
    row.failure = error.what();
    row.error.reset();
  }
  return row;
}

Row measureStatistics(const PreparedScene& scene, const TrueStatistics& truth, double duration,
                      const Entrant& entrant, double step) {
  Row row = startRow(Part::statistics, scene, entrant, step);
  row.steps = std::max<std::uint64_t>(static_cast<std::uint64_t>(duration / step), 1);
  row.simulated = static_cast<double>(row.steps) * step;
  row.true_rate = truth.rate;
  row.true_pressure = truth.pressure;
  const auto count = static_cast<double>(scene.balls.size());
  if (truth.rate) row.noise = 1 / std::sqrt(*truth.rate * count / 2 * row.simulated);
  BallStates states;
  const double true_energy = squareSum(scene.balls) / 2;
  try {
    const auto run = entrant.make(scene.surroundings, scene.balls, step);
    std::vector<Impact> impacts;
    if (entrant.kind == Kind::peer) {
      run->takeImpacts(impacts);
      for (std::uint64_t i = 0; i < row.steps; ++i) {
        const double begin = cpuSeconds();
        run->advance(1);
        row.cpu += cpuSeconds() - begin;
        run->takeImpacts(impacts);
      }
    } else {
      const double begin = cpuSeconds();
      run->advance(row.steps);
      row.cpu = cpuSeconds() - begin;
    }
    run->read(states);
    row.failure = defect(scene, states, true_energy);
    if (!row.failure.empty()) return row;
    row.energy_error = std::abs(energyOf(scene, states) - true_energy) / true_energy;
    row.overlap =
        std::max(deepestOverlap(scene, states), run->work().deepest_overlap) / scene.reach;
    row.events = run->work().events;
    const auto pairs = std::count_if(impacts.begin(), impacts.end(),
                                     [](const Impact& impact) { return impact.b >= 0; });
    row.impacts = run->work().ball_collisions.value_or(static_cast<std::uint64_t>(pairs));
    row.rate = 2 * static_cast<double>(*row.impacts) / count / row.simulated;
    if (truth.pressure && run->work().virial) {
      const double thermal = 3 * temperature(scene) * count * row.simulated;
      row.pressure = 1 + *run->work().virial / thermal;
    }
  } catch (const std::exception& error) {
    row.failure = error.what();
  }
  return row;
}

std::string csvHeader() {
  return "part,scene,entrant,kind,k,step,phase,balls,steps,simulated,cpu,events,error,valid_time,"
         "valid_to_end,energy_error,momentum_error,overlap,true_impacts,impacts,missed,extra,rate,"
         "true_rate,pressure,true_pressure,noise,failure";
}

std::string csvLine(const Row& row) {
  std::string failure = row.failure;
  std::replace(failure.begin(), failure.end(), ',', ';');
  std::replace(failure.begin(), failure.end(), '\n', ' ');
  const std::vector<std::string> fields = {row.part == Part::path ? "path" : "statistics",
                                           row.scene,
                                           row.entrant,
                                           nameOf(row.kind),
                                           std::to_string(row.exponent),
                                           number(row.step),
                                           number(row.phase),
                                           std::to_string(row.balls),
                                           std::to_string(row.steps),
                                           number(row.simulated),
                                           number(row.cpu),
                                           field(row.events),
                                           field(row.error),
                                           field(row.valid_time),
                                           row.valid_to_end ? "1" : "0",
                                           field(row.energy_error),
                                           field(row.momentum_error),
                                           field(row.overlap),
                                           field(row.true_impacts),
                                           field(row.impacts),
                                           field(row.missed),
                                           field(row.extra),
                                           field(row.rate),
                                           field(row.true_rate),
                                           field(row.pressure),
                                           field(row.true_pressure),
                                           field(row.noise),
                                           failure};
  std::string line;
  for (const std::string& one : fields) line += (line.empty() ? "" : ",") + one;
  return line;
}

}  // namespace ball_sim::core::chart
