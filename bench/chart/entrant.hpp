// What stands on the chart: our methods and other engines, behind one small interface.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "scene_plan.hpp"
#include "trajectory.hpp"

namespace ball_sim::core::chart {

/// What a simulation counted since it began; absent: it does not tell.
struct Work {
  std::optional<std::uint64_t> events;           ///< all events handled, real impacts or not
  std::optional<std::uint64_t> ball_collisions;  ///< impacts of two balls
  std::optional<double> virial;                  ///< J, impulse times distance, summed
  double deepest_overlap = 0;                    ///< m, as far as the simulation noticed it
};

/// A simulation that goes on in equal steps, begun at date 0.
class Simulation {
 public:
  virtual ~Simulation() = default;

  /// Goes on by so many steps. @throws std::exception  it cannot; what() says why
  virtual void advance(std::uint64_t steps) = 0;

  /// All balls after the last step, ids from 0.
  virtual void read(BallStates& states) = 0;

  /// Appends the impacts that began since the last call. A simulation that tells only which
  /// partners touch after a step has to be asked after each.
  virtual void takeImpacts(std::vector<Impact>& impacts) = 0;

  virtual Work work() const { return {}; }
};

/// How an entrant meets time.
enum class Kind {
  exact,    ///< from event to event: no time step
  stepped,  ///< in steps; swept
  peer,     ///< another engine, in steps; swept
};

/// One line of the chart.
struct Entrant {
  std::string name;
  std::string version;  ///< of the library, or empty
  Kind kind = Kind::exact;
  /// CPU time of one ball in one step, ns, roughly: says how fine its steps may become. Fixed, so
  /// that the rows of a report do not depend on the machine.
  double cost = 100;
  double setup_cost = 0;  ///< CPU time to set up one ball, s, likewise
  /// Why it cannot run a scene; empty: it can.
  std::function<std::string(const PreparedScene&)> refusal;
  /// @param step  s
  std::function<std::unique_ptr<Simulation>(const Surroundings&, const std::vector<Ball>&,
                                            double step)>
      make;
};

/// Our methods, all that methodNames() lists.
std::vector<Entrant> ownMethods();

}  // namespace ball_sim::core::chart
