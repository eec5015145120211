// What statistical mechanics says of fluids of hard balls. sigma: diameter, eta: packing fraction,
// Z = p V / (N k T): compressibility factor.
#pragma once

#include <cmath>

namespace ball_sim::core {
namespace test {

/// Z of hard spheres, good to about 0.3 % in the fluid.
/// Source: Carnahan, Starling, "Equation of state for nonattracting rigid spheres", 1969.
inline double compressibilityOfSpheres(double eta) {
  return (1 + eta + eta * eta - eta * eta * eta) / std::pow(1 - eta, 3);
}

/// Z of hard discs; below eta = 0.5 good to about 1 %.
/// Source: Henderson, "A simple equation of state for hard discs", 1975.
inline double compressibilityOfDiscs(double eta) {
  return (1 + eta * eta / 8) / ((1 - eta) * (1 - eta));
}

/// Z from the rate of collisions: Z - 1 = Gamma sigma sqrt(pi m / kT) / (2 dimension), exact at any
/// density in the limit of many balls.
/// @param rate  Gamma, collisions per ball and second, 1/s (each impact counts for both balls)
/// @param thermal_speed  sqrt(kT/m), m/s
inline double compressibilityFromRate(double rate, double sigma, double thermal_speed,
                                      int dimension) {
  return 1 + rate * sigma * std::sqrt(3.14159265358979323846) / thermal_speed / (2 * dimension);
}

}  // namespace test
}  // namespace ball_sim::core
