// Seeded random numbers that are the same with every standard library.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {
namespace test {

/// The standard fixes the bits of the engine but not those of its distributions, so these are ours.
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t seed) : engine_(seed) {}

  /// Evenly in [lower, upper).
  double uniform(double lower, double upper) {
    return lower + (upper - lower) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }

  /// 0 .. count - 1. @param count > 0
  std::size_t index(std::size_t count) { return static_cast<std::size_t>(engine_() % count); }

  bool chance(double probability) { return uniform(0, 1) < probability; }

  /// Normal with standard deviation 1 (Box, Muller 1958).
  double gaussian() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform(0, 1)));
    return radius * std::cos(2 * 3.14159265358979323846 * uniform(0, 1));
  }

  /// Each component normal with standard deviation `sigma`.
  Vector3 gaussianVector(double sigma) {
    const double x = gaussian();
    const double y = gaussian();
    const double z = gaussian();
    return sigma * Vector3(x, y, z);
  }

  /// Evenly on the unit sphere.
  Vector3 direction() {
    while (true) {
      const Vector3 v = gaussianVector(1);
      if (v.norm() > 0.01) return v / v.norm();
    }
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace test
}  // namespace ball_sim::core
