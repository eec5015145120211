// Which methods the physics tests run on. A test of exact physics takes each method of the list as
// a parameter, so that a new exact method has only to be named here to face them all.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "ball_sim/methods.hpp"

namespace ball_sim::core {
namespace test {

/// The slow twin: right by its plainness, and the reference of the others.
constexpr const char* kSlowTwin = "brute_force";

/// The methods that are exact to rounding and that this build has, the slow twin among them.
inline std::vector<std::string> exactMethods() {
  std::vector<std::string> found;
  for (const char* name : {kSlowTwin, "event_driven", "continuous"}) {
    const auto& known = methodNames();
    if (std::find(known.begin(), known.end(), name) != known.end()) found.push_back(name);
  }
  return found;
}

/// The methods that can take impacts of one instant together.
inline std::vector<std::string> jointMethods() { return {kSlowTwin, "event_driven"}; }

/// The exact methods fit for large cases: all but the slow twin.
inline std::vector<std::string> fastMethods() {
  std::vector<std::string> found = exactMethods();
  found.erase(std::remove(found.begin(), found.end(), kSlowTwin), found.end());
  return found;
}

/// Names a test after the method it runs on.
inline std::string methodOf(const testing::TestParamInfo<std::string>& instance) {
  return instance.param;
}

}  // namespace test
}  // namespace ball_sim::core
