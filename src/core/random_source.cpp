// Random numbers that are the same bits on every machine.
#include "ball_sim/random_source.hpp"

#include <cmath>

namespace ball_sim::core {
namespace {

// Natural logarithm from its series in t = (m - 1)/(m + 1), |t| < 0.172: 2 (t + t^3/3 + ...); what
// is left out after t^21 is below 1e-18.
double naturalLogarithm(double x) {
  constexpr double kLog2 = 0.69314718055994530942;
  int exponent = 0;
  double m = std::frexp(x, &exponent);  // exact
  if (m < 0.70710678118654752) {
    m *= 2;
    --exponent;
  }
  const double t = (m - 1) / (m + 1);
  double series = 0;
  for (int k = 21; k >= 1; k -= 2) series = series * t * t + 1.0 / k;
  return exponent * kLog2 + 2 * t * series;
}

}  // namespace

// The polar method; the second number of each pair is not kept, so that a draw depends on nothing
// but the engine. Source: Marsaglia, Bray, SIAM Review 6 (1964).
double RandomSource::normal() {
  while (true) {
    const double u = uniform(-1, 1);
    const double v = uniform(-1, 1);
    const double s = u * u + v * v;
    if (s > 0 && s < 1) return u * std::sqrt(-2 * naturalLogarithm(s) / s);
  }
}

// Draws that would favour small numbers are thrown away.
std::uint64_t RandomSource::below(std::uint64_t count) {
  const std::uint64_t excess = (std::mt19937_64::max() % count + 1) % count;
  while (true) {
    const std::uint64_t draw = engine_();
    if (draw <= std::mt19937_64::max() - excess) return draw % count;
  }
}

}  // namespace ball_sim::core
