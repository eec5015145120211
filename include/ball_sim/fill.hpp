// Turns a scene's data into the balls it starts with.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "ball_sim/scene.hpp"

namespace ball_sim {

/// Balls that could not be placed; what() tells how far it came and what would fit.
class PackingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The scene's balls in order of id: those listed, then each fill's. Sets the infinite extents of
/// `scene.surroundings.box` where a fill gives a packing fraction.
/// @throws PackingError  a fill that cannot be packed
std::vector<Ball> populate(Scene& scene);

/// Random balls within the surroundings that overlap neither each other nor `present`.
/// @param box  finite; centres are drawn so that balls stay inside closed faces
/// @throws PackingError
std::vector<Ball> fillBox(const Fill& fill, const Surroundings& surroundings,
                          const std::vector<Ball>& present);

}  // namespace ball_sim
