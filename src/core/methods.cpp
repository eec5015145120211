#include "ball_sim/methods.hpp"

#include <algorithm>
#include <stdexcept>

#include "ball_sim/brute_force.hpp"

namespace ball_sim {

namespace {

std::string listOf(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

[[noreturn]] void refuse(const std::string& name) {
  throw std::invalid_argument("method: '" + name + "': must be one of " + listOf(methodNames()));
}

template <class Real>
std::unique_ptr<Method> make(const std::string& name, const Surroundings& surroundings) {
  if (name == "brute_force") return std::make_unique<BruteForce<Real>>(surroundings);
  refuse(name);
}

}  // namespace

const std::vector<std::string>& methodNames() {
  static const std::vector<std::string> names = {"auto", "brute_force"};
  return names;
}

MethodChoice chooseMethod(const std::string& name, const Scene& /*scene*/) {
  if (name == "auto") return {"brute_force", "the only method so far"};
  const auto& names = methodNames();
  if (std::find(names.begin(), names.end(), name) == names.end()) refuse(name);
  return {name, "asked for"};
}

std::unique_ptr<Method> makeMethod(const std::string& name, const Surroundings& surroundings,
                                   Precision precision) {
  return precision == Precision::long_double ? make<long double>(name, surroundings)
                                             : make<double>(name, surroundings);
}

}  // namespace ball_sim
