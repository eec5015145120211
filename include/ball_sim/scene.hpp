// A scene: the data that name all that is modelled.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// A closed interval a value is drawn from evenly; lower == upper: that value.
struct Range {
  double lower = 0;
  double upper = 0;
};

/// A seeded set of random balls without overlap.
struct Fill {
  std::size_t count = 0;
  Range radius;                            ///< m
  std::optional<Range> mass;               ///< kg; or
  std::optional<double> density;           ///< kg/m^3 (planar scenes too: balls, not discs)
  double speed_sigma = 0;                  ///< m/s, standard deviation of each velocity component
  std::uint64_t seed = 0;                  ///< the same seed gives the same balls, bit for bit
  std::optional<double> packing_fraction;  ///< sizes the scene's infinite box extents instead
};

/// How two or more impacts at one instant that share a ball are resolved.
enum class SimultaneousImpacts { sequential, simultaneous };

/// A whole scene. What is left at its default is not modelled and costs nothing.
struct Scene {
  std::string name;
  Surroundings surroundings;
  std::vector<Ball> balls;
  std::vector<Fill> fill;
  std::string method = "auto";
  std::optional<double> time_step;  ///< s, for the stepping methods; absent: one that fits
  std::optional<double> tolerance;  ///< relative to a radius; absent: as exact as can be
  SimultaneousImpacts simultaneous_impacts = SimultaneousImpacts::sequential;
};

}  // namespace ball_sim::core
