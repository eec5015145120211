// The command line of ball_sim_run.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>

#include "ball_sim/methods.hpp"

namespace ball_sim::core {

/// An argument that was refused; what() reads "ARGUMENT: VALUE: RULE".
class ArgumentError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What a run was asked to do. Empty text: not asked for.
struct RunOptions {
  bool help = false;
  bool version = false;
  std::string scene;                ///< path
  double until = 0;                 ///< s, > 0
  std::string method;               ///< empty: the scene's
  std::optional<double> time_step;  ///< s, > 0; absent: the scene's
  std::optional<double> every;      ///< s, > 0, between states; absent: start and end only
  std::string out;                  ///< path of the states
  std::string events;               ///< path of the impacts
  std::string stats;                ///< path of the statistics
  Precision precision = Precision::double_precision;
  unsigned threads = 1;   ///< >= 1
  bool progress = false;  ///< even where there is no terminal
};

/// The whole help text.
std::string helpText();

/// @throws ArgumentError  unknown, incomplete, repeated or out of range
RunOptions parseArguments(int argc, const char* const* argv);

}  // namespace ball_sim::core
