// Random numbers that are the same bits on every machine.
#pragma once

#include <cstdint>
#include <random>

namespace ball_sim::core {

/// Seeded random numbers. The standard fixes what its engine gives but not what its distributions
/// make of it, nor the last bit of a logarithm; so both are made here from + - * / and sqrt alone.
class RandomSource {
 public:
  explicit RandomSource(std::uint64_t seed) : engine_(seed) {}

  /// Evenly in [0, 1), in steps of 2^-53.
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

  /// Evenly in [lower, upper].
  double uniform(double lower, double upper) {
    const double value = lower + uniform() * (upper - lower);
    return value < upper ? value : upper;
  }

  /// Normal with mean 0 and standard deviation 1.
  double normal();

  /// Evenly in 0..count-1. @param count > 0
  std::uint64_t below(std::uint64_t count);

 private:
  std::mt19937_64 engine_;
};

}  // namespace ball_sim::core
