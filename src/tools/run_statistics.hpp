// The statistics of a run, and the JSON that ball_sim_run writes of them.
#pragma once

#include <optional>
#include <string>

#include "ball_sim/world.hpp"

namespace ball_sim::core {

/// What is conserved, or should be, at one instant.
struct Conserved {
  double kinetic_energy = 0;           ///< J
  double potential_energy = 0;         ///< J
  Vector3 momentum = Vector3::Zero();  ///< kg m/s
};

Conserved conservedIn(const World& world);

struct RunRecord {
  double until = 0;         ///< s, asked for
  double wall_seconds = 0;  ///< of advancing alone
  double cpu_seconds = 0;   ///< of advancing alone, all threads
  Conserved before;
  std::string error;  ///< why the run ended early; empty: it did not
};

/// Change of kinetic and potential energy, relative to the larger of their sum and the kinetic
/// energy before (after, where nothing moved before); 0 where there is none at all.
double energyDrift(const Conserved& before, const Conserved& after);

/// P V / (N k T) by the virial: 1 + W / (dim N k T t), W the sum of impulse times distance of
/// centres over all impacts; k T from the kinetic energy relative to the centre of mass, which has
/// dim (N - 1) degrees of freedom. Source: Hansen, McDonald, Theory of Simple Liquids, 2.2.
/// @return nothing unless the box is periodic, without gravity, restitution is 1, at least two
///         balls are there, all free, and they move
std::optional<double> compressibility(const World& world, const Conserved& before);

/// All of it, as JSON.
std::string statisticsJson(const World& world, const RunRecord& record);

}  // namespace ball_sim::core
