// The statistics of a run, and the JSON that ball_sim_run writes of them.
#include "run_statistics.hpp"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "ball_sim/observables.hpp"

namespace ball_sim::core {
namespace {

std::string json(double value) {
  if (!std::isfinite(value)) return "null";  // JSON has no other word
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

std::string json(const Vector3& v) {
  return "[" + json(v.x()) + ", " + json(v.y()) + ", " + json(v.z()) + "]";
}

std::string json(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + "\"";
}

// As text: a JSON number would lose the lower bits in most readers.
std::string hashText(const World& world) {
  BallStates states;
  world.read(states);
  char text[24];
  std::snprintf(text, sizeof text, "%016" PRIx64, stateHash(states));
  return text;
}

}  // namespace

Conserved conservedIn(const World& world) {
  return {world.kineticEnergy(), world.potentialEnergy(), world.momentum()};
}

double energyDrift(const Conserved& before, const Conserved& after) {
  const double energy = before.kinetic_energy + before.potential_energy;
  const double change = after.kinetic_energy + after.potential_energy - energy;
  double scale = std::max(std::abs(energy), before.kinetic_energy);
  if (scale == 0) scale = after.kinetic_energy;
  return scale > 0 ? change / scale : 0;
}

std::optional<double> compressibility(const World& world, const Conserved& before) {
  const Surroundings& around = world.surroundings();
  const auto balls = static_cast<double>(world.size());
  const double seconds = world.now().seconds();
  if (!around.periodic || around.gravity != Vector3::Zero() || around.restitution != 1 ||
      balls < 2 || !(seconds > 0)) {
    return std::nullopt;
  }
  double mass = 0;  // kg
  for (const double m : world.masses()) mass += m;
  if (std::isinf(mass)) return std::nullopt;
  const double drift = dot(before.momentum, before.momentum) / (2 * mass);
  const double dim_kt = 2 * (before.kinetic_energy - drift) / (balls - 1);
  // What is left of a difference of like numbers is rounding.
  if (!(before.kinetic_energy - drift > 1e-9 * before.kinetic_energy)) return std::nullopt;
  return 1 + world.statistics().virial / (balls * dim_kt * seconds);
}

std::string statisticsJson(const World& world, const RunRecord& record) {
  const Statistics counted = world.statistics();
  const Conserved after = conservedIn(world);
  const std::optional<double> z = compressibility(world, record.before);
  const double balls = std::max<double>(1, static_cast<double>(world.size()));
  std::ostringstream text;
  text << "{\n"
       << "  \"balls\": " << world.size() << ",\n"
       << "  \"until\": " << json(record.until) << ",\n"
       << "  \"reached\": " << json(world.now().seconds()) << ",\n"
       << "  \"method\": " << json(world.method().name) << ",\n"
       << "  \"method_reason\": " << json(world.method().reason) << ",\n"
       << "  \"ball_collisions\": " << counted.ball_collisions << ",\n"
       << "  \"wall_collisions\": " << counted.wall_collisions << ",\n"
       << "  \"events\": " << counted.events << ",\n"
       << "  \"ambiguous_impacts\": " << counted.ambiguous_impacts << ",\n"
       << "  \"wall_seconds\": " << json(record.wall_seconds) << ",\n"
       << "  \"cpu_seconds\": " << json(record.cpu_seconds) << ",\n"
       << "  \"kinetic_energy_before\": " << json(record.before.kinetic_energy) << ",\n"
       << "  \"kinetic_energy_after\": " << json(after.kinetic_energy) << ",\n"
       << "  \"energy_drift\": " << json(energyDrift(record.before, after)) << ",\n"
       << "  \"momentum_before\": " << json(record.before.momentum) << ",\n"
       << "  \"momentum_after\": " << json(after.momentum) << ",\n"
       << "  \"deepest_overlap\": " << json(counted.deepest_overlap) << ",\n"
       << "  \"compressibility\": " << (z ? json(*z) : "null") << ",\n"
       << "  \"bytes_per_ball\": " << json(static_cast<double>(counted.bytes) / balls) << ",\n"
       << "  \"state_hash\": " << json(hashText(world)) << ",\n"
       << "  \"error\": " << (record.error.empty() ? "null" : json(record.error)) << "\n"
       << "}\n";
  return text.str();
}

}  // namespace ball_sim::core
