// How far a run is, for people who wait.
#pragma once

#include <chrono>

namespace ball_sim::core {

/// Writes to stderr: on a terminal one line that is drawn again and again, elsewhere a line every
/// few seconds.
class ProgressBar {
 public:
  /// @param until  s of simulated time
  /// @param asked  show it even where there is no terminal
  ProgressBar(double until, bool asked);

  /// Draws, when the last drawing is long enough ago. @param time s of simulated time
  void show(double time);

  /// Draws the last state and ends the line.
  void finish(double time);

 private:
  using Clock = std::chrono::steady_clock;

  void draw(double time);

  double until_;
  bool terminal_;
  bool shown_;
  Clock::time_point start_;
  Clock::time_point last_;
};

}  // namespace ball_sim::core
