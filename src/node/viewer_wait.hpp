// The wait for RViz, so that the beginning is seen.
#pragma once

#include <chrono>
#include <string>

namespace ball_sim {

/// Waits until RViz shows a topic, but not for ever.
///
/// RViz subscribes seconds before its window opens, and others listen too. What tells is its
/// service ~reload_shaders: RViz advertises it last, when its window is there. So the node is
/// waited for that both subscribes to the topic and has that service, as the ROS master knows, and
/// then a moment for the first picture.
class ViewerWait {
 public:
  using Clock = std::chrono::steady_clock;

  /// Begins to wait, and says so.
  /// @param topic     full name
  /// @param patience  s of wall time, > 0
  ViewerWait(std::string topic, double patience);

  /// Whether the wait is over. To be asked often: asks the ROS master a few times a second.
  bool over(Clock::time_point now);

 private:
  const std::string topic_;
  const double patience_;  // s
  Clock::time_point end_;
  Clock::time_point next_look_;
  bool shown_ = false;
};

}  // namespace ball_sim
