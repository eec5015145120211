// Random balls of 1 kg: the gases that tests begin with where nothing else is asked of them.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "ball_sim/fill.hpp"
#include "trial.hpp"

namespace ball_sim::core {
namespace test {

/// Balls of 1 kg with Gaussian velocities of 1 m/s an axis; always the same ones.
/// @param radius            m, drawn evenly from this range
/// @param packing_fraction  sizes the open extents of the scene's box; none: the box has its size
inline Fill fillOf(std::size_t count, Range radius, std::optional<double> packing_fraction = {}) {
  Fill fill;
  fill.count = count;
  fill.radius = radius;
  fill.mass = Range{1, 1};
  fill.speed_sigma = 1;
  fill.seed = 1;
  fill.packing_fraction = packing_fraction;
  return fill;
}

/// A scene of nothing but a fill, in a periodic cube that the fill's packing fraction sizes.
inline Scene periodicScene(const Fill& fill) {
  Scene scene;
  scene.surroundings.periodic = true;
  scene.fill = {fill};
  return scene;
}

/// The scene with its balls placed.
/// @throws PackingError
inline TestScene placed(Scene scene) {
  std::vector<Ball> balls = populate(scene);  // sizes the box, too
  return {scene.surroundings, std::move(balls)};
}

}  // namespace test
}  // namespace ball_sim::core
