// Turns a scene's data into the balls it starts with.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "ball_sim/scene.hpp"

namespace ball_sim::core {

/// Balls that could not be placed; what() tells how far it came and what would fit.
class PackingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The scene's balls in order of id: those listed, then each fill's. Fills of larger balls are
/// placed first.
///
/// Where a fill gives a packing fraction, the infinite extents of `scene.surroundings.box` get one
/// common length, such that all balls of the scene, listed ones included, take up that share of the
/// box's volume (planar: of its area). An extent that is open on both sides is put around 0, one
/// that is open on one side begins at the other. Faces that were open are closed thereby.
/// @throws PackingError  a fill that cannot be packed
std::vector<Ball> populate(Scene& scene);

/// Random balls within the surroundings that overlap neither each other nor `present`; the same
/// seed gives the same bits on every machine.
///
/// One after the other goes to a random free place while that is quick, up to a packing fraction of
/// 0.30 (planar 0.44; 0.10 and 0.15 for more than 20000 equal balls). Denser fills are packed by
/// pushing balls apart from random places, to about 0.60 (0.80), or, equal balls alone, put on
/// random sites of a lattice, to about 0.70 (0.88): then the start is a crystal with vacancies,
/// which melts as it runs. Limits: dense fills of more than about 50000 unequal balls are refused.
/// @param box  finite; centres are drawn so that balls stay inside closed faces
/// @throws PackingError
std::vector<Ball> fillBox(const Fill& fill, const Surroundings& surroundings,
                          const std::vector<Ball>& present);

}  // namespace ball_sim::core
