// The scenes of the chart: which question each asks, how far its trajectories can be compared, and
// how it is prepared.
#pragma once

#include <string>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core::chart {

/// Where the truth about a scene comes from.
enum class Truth {
  all_pairs,  ///< 256-bit arithmetic: all pairs, by the templates of brute_force
  oracle,     ///< 256-bit arithmetic: oracle.hpp, for many balls
  at_rest,    ///< closed form: nothing moves
};

/// How a reader is told of it.
const char* nameOf(Truth truth);

/// One scene of the chart.
struct ScenePlan {
  std::string name;       ///< as in the rows
  std::string file;       ///< YAML, from the source folder
  std::string question;   ///< what a method has to get right here, in a few words
  double speed = 1;       ///< m/s, v: the steppers' longest step is R/v
  double horizon = 0;     ///< s, trajectories are compared up to here: below the chaos horizon
  double statistics = 0;  ///< s, rates are counted for so long; 0: no statistics
  double mixing = 0;      ///< s, run before the start, so that a fluid is in equilibrium
  Truth truth = Truth::all_pairs;
  int repeats = 20;  ///< of a run at most
};

/// All scenes, in the order of the report.
const std::vector<ScenePlan>& scenePlans();

/// A scene, ready to start.
struct PreparedScene {
  ScenePlan plan;
  Surroundings surroundings;
  std::vector<Ball> balls;
  double reach = 0;  ///< m, R: the smallest sum of radii, or the radius of a single ball

  bool planar() const { return surroundings.planar(); }
};

/// Reads, fills and mixes. @param source_folder  the checkout
/// @throws what the reader and the filling throw
PreparedScene prepare(const ScenePlan& plan, const std::string& source_folder);

}  // namespace ball_sim::core::chart
