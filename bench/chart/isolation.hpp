// Runs a piece of work in a process of its own: other engines may abort, or never come back.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace ball_sim::core::chart {

/// What became of a piece of work.
struct Outcome {
  std::vector<std::string> lines;  ///< what it gave
  std::string failure;             ///< empty: it ended by itself, and well
};

/// @param work     calls its argument with each line of its result, in the other process
/// @param seconds  s of CPU time, >= 1, after which it is ended (and eight times as much by the
/// clock)
Outcome runIsolated(const std::function<void(const std::function<void(const std::string&)>&)>& work,
                    double seconds);

}  // namespace ball_sim::core::chart
