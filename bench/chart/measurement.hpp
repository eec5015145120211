// Measures one run: what it cost, and what it got wrong. A row carries all its witnesses.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "entrant.hpp"

namespace ball_sim::core::chart {

/// Which of the two kinds of run a row is.
enum class Part {
  path,        ///< up to the horizon, compared with the truth
  statistics,  ///< longer: rates and invariants only
};

/// One run. Absent: cannot be said of this scene or entrant.
struct Row {
  Part part = Part::path;
  std::string scene;
  std::string entrant;
  Kind kind = Kind::exact;
  int exponent = 0;  ///< k of the step R/v 2^-k
  double step = 0;   ///< s; of an exact method: between looks at it
  double phase = 0;  ///< start of the run, in steps
  std::size_t balls = 0;
  std::uint64_t steps = 0;
  double simulated = 0;                 ///< s
  double cpu = 0;                       ///< s
  std::optional<std::uint64_t> events;  ///< handled, real impacts or not
  std::optional<double> error;          ///< largest |dx|/R in the end
  std::optional<double>
      valid_time;             ///< s from the start to the last look before an error of 0.01 R
  bool valid_to_end = false;  ///< it never was
  std::optional<double> energy_error;    ///< of the energy at the start
  std::optional<double> momentum_error;  ///< of the sum of |m v|
  std::optional<double> overlap;         ///< deepest, of R
  std::optional<std::uint64_t> true_impacts;
  std::optional<std::uint64_t> impacts;  ///< counted, walls included
  std::optional<double> missed;          ///< share of the true impacts that did not happen
  std::optional<double> extra;           ///< impacts that are not true, of the true ones
  std::optional<double> rate;            ///< collisions per ball and second
  std::optional<double> true_rate;
  std::optional<double> pressure;  ///< Z = p V/(N k T), from the virial
  std::optional<double> true_pressure;
  std::optional<double> noise;  ///< 1/sqrt(number of collisions that were to come)
  std::string failure;          ///< why it is of no use; empty: it is
};

/// What the statistics of a scene should be.
struct TrueStatistics {
  std::optional<double> rate;      ///< collisions per ball and second
  std::optional<double> pressure;  ///< Z
};

/// From theory where the scene is periodic, else from a long exact run.
TrueStatistics trueStatistics(const PreparedScene& scene);

/// A run from `phase` steps after the start to the horizon.
/// @param horizon  s
Row measurePath(const PreparedScene& scene, const Trajectory& truth, double horizon,
                const Entrant& entrant, double step, double phase);

/// A run from the start for `duration` seconds.
Row measureStatistics(const PreparedScene& scene, const TrueStatistics& truth, double duration,
                      const Entrant& entrant, double step);

/// The line with the names of a row's fields.
std::string csvHeader();

/// A row as a line.
std::string csvLine(const Row& row);

}  // namespace ball_sim::core::chart
