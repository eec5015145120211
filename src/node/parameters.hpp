// The node's private parameters, checked.
#pragma once

#include <ros/node_handle.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>

#include "coloring.hpp"

namespace ball_sim {

/// A parameter that was refused; what() names it, its value and the rule.
class ParameterError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Private parameters of ball_sim_node; the ranges are those that readParameters() accepts.
struct Parameters {
  std::string scene = "break_shot";  ///< path of a file, or name of a shipped scene
  std::string method;                ///< a method's name; empty: the scene's
  std::optional<double> time_step;   ///< s, 1e-9..1, for stepping methods; absent (or 0): the
                                     ///< scene's
  std::optional<double> tolerance;   ///< error one may make, of a radius, 1e-15..1; absent (or 0):
                                     ///< the scene's
  int threads = 1;                   ///< 1..1024, of method continuous; changes no bit
  std::optional<std::int64_t> seed;  ///< >= 0: fill k gets seed + k; absent (or -1): the scene's
  std::string frame_id = "world";    ///< frame of all positions; not empty
  double real_time_factor = 1;       ///< simulated per wall second, 0.001..1000;
                                     ///< 0: as fast as possible
  double clock_rate = 100;           ///< Hz of wall time, 10..250: /clock and the node's frames
  double state_rate = 50;            ///< Hz of simulated time, 0.001..1000; 0: no ~ball_states
  double marker_rate = 25;           ///< Hz of wall time, 0.1..60; 0: no ~markers
  bool publish_clock = true;         ///< false: another node owns /clock
  bool start_paused = false;
  double wait_for_viewer = 0;       ///< s of wall time, 0.1..600: start paused, and resume when
                                    ///< RViz shows ~markers, or after so long; 0, or start_paused:
                                    ///< no wait. ~pause, ~resume, ~toggle_pause and ~step end it
  double start_time = 1;            ///< s, 1e-9..4e9: ROS time of simulated time 0
  int max_balls = 1000000;          ///< 1..10000000
  int max_events_per_frame = 1000;  ///< 1..1e9: after so many events without a pause the node looks
                                    ///< after the clock, commands and shutdown
  double wall_timeout = 5;          ///< s of wall time, 0.1..60: a service answers within it
  ColorBy color_by = ColorBy::id;   ///< speed, id, radius, mass
};

/// Reads what is set, keeps the defaults of what is not, and warns of parameters it does not know,
/// naming the nearest known one, or all when none is near.
/// @throws ParameterError  wrong type or out of range
Parameters readParameters(const ros::NodeHandle& private_node);

}  // namespace ball_sim
