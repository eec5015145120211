// All methods by name, and the choice among them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ball_sim/method.hpp"
#include "ball_sim/scene.hpp"

namespace ball_sim::core {

/// The arithmetic a method runs in. long_double (64-bit significand on x86-64) is slower and there
/// to tell rounding from error: what does not shrink with it is a bug, not rounding.
enum class Precision { double_precision, long_double };

/// A method's name, and why it was taken.
struct MethodChoice {
  std::string name;
  std::string reason;
};

/// The names a scene may use, `auto` first.
const std::vector<std::string>& methodNames();

/// Settles `auto`; any other name is taken as it is.
/// @throws std::invalid_argument  an unknown name, listing the known ones
MethodChoice chooseMethod(const std::string& name, const Scene& scene);

/// @param name  a known name other than `auto`
/// @throws std::invalid_argument  an unknown name
std::unique_ptr<Method> makeMethod(const std::string& name, const Surroundings& surroundings,
                                   Precision precision = Precision::double_precision);

}  // namespace ball_sim::core
