// What stands around the balls and acts on all of them: gravity, restitution, box, planes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// Axis-aligned box, m. A face at -infinity or +infinity is open. A box without height
/// (min.z == max.z) makes the scene planar: every ball rolls at that z, with no z faces to hit.
struct Box {
  Vector3 min = Vector3::Constant(-std::numeric_limits<double>::infinity());
  Vector3 max = Vector3::Constant(std::numeric_limits<double>::infinity());
};

/// A fixed half-space: points x with normal.x >= offset are inside.
struct Plane {
  Vector3 normal = Vector3::UnitZ();  ///< unit length, points to the inside
  double offset = 0;                  ///< m
};

/// What surrounds the balls. The defaults model nothing at all: free flight in open space.
struct Surroundings {
  Vector3 gravity = Vector3::Zero();  ///< m/s^2
  double restitution = 1;             ///< 0..1, ball-ball and walls: share of approach speed kept
  Box box;
  bool periodic = false;  ///< the box (all faces finite, or planar) wraps instead of reflecting
  std::vector<Plane> planes;

  bool planar() const { return box.min.z() == box.max.z(); }
};

/// Names what a ball hit, as the second partner of a collision: a ball's id (>= 0), or a wall:
/// -1 x-min, -2 x-max, -3 y-min, -4 y-max, -5 z-min, -6 z-max, -7 - k plane k of the scene.
using Partner = std::int64_t;

constexpr Partner boxFace(int axis, bool upper) { return -1 - 2 * axis - (upper ? 1 : 0); }
constexpr Partner planePartner(std::size_t index) { return -7 - static_cast<Partner>(index); }

}  // namespace ball_sim::core
