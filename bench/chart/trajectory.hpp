// The true motion of a scene's balls: free flights between impacts, to be asked at any date.
#pragma once

#include <cstdint>
#include <vector>

#include "ball_sim/method.hpp"
#include "scene_plan.hpp"

namespace ball_sim::core::chart {

/// Two partners that met.
struct Impact {
  BallId a = 0;   ///< the smaller id of two balls
  Partner b = 0;  ///< the other ball, or a wall
  bool operator<(const Impact& o) const { return a != o.a ? a < o.a : b < o.b; }
  bool operator==(const Impact& o) const { return a == o.a && b == o.b; }
};

/// Makes an impact of a ball and its partner, ids in order.
Impact impactOf(BallId a, Partner b);

/// The motion of all balls up to a date.
///
/// Assumes that between impacts every ball flies under the same constant acceleration: none rests.
class Trajectory {
 public:
  /// Place and velocity at one instant.
  struct State {
    Vector3 position;  ///< m, in a periodic box any image
    Vector3 velocity;  ///< m/s
  };

  Trajectory() = default;

  /// @param acceleration  of every ball, m/s^2
  Trajectory(const std::vector<Ball>& balls, const Vector3& acceleration);

  /// From `seconds` on, the ball flies on from this state. Dates of one ball ascend.
  void add(BallId id, double seconds, const State& state);

  /// Notes that partners met. Dates ascend.
  void addImpact(double seconds, const Impact& impact);

  /// @param seconds  s, >= 0
  State at(BallId id, double seconds) const;

  std::size_t size() const { return flights_.size(); }

  /// Who met after `from`, up to and with `to`, sorted.
  std::vector<Impact> impactsWithin(double from, double to) const;

 private:
  struct Flight {
    double begin;  // s
    State state;
  };
  struct DatedImpact {
    double date;  // s
    Impact impact;
  };

  std::vector<std::vector<Flight>> flights_;  // one list a ball
  std::vector<DatedImpact> impacts_;
  Vector3 acceleration_ = Vector3::Zero();  // m/s^2
};

/// Runs a method to a date and keeps the whole motion.
/// @param method  holds the balls, ids from 0, at date 0
Trajectory record(Method& method, const PreparedScene& scene, double until);

/// All pairs at every event in 256-bit arithmetic, by the templates of method brute_force.
/// @param until  s
Trajectory allPairsTrajectory(const PreparedScene& scene, double until);

/// The truth about a scene up to its horizon. @param until  s
Trajectory trueTrajectory(const PreparedScene& scene, double until);

}  // namespace ball_sim::core::chart
