// The walls of a scene, box faces and planes alike, and balls that rest on them.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "ball_sim/surroundings.hpp"
#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// A rigid wall at rest: inside is normal.x >= offset.
template <class Real>
struct Wall {
  VectorOf<Real> normal;  ///< unit, inward
  Real offset;            ///< m
  Partner partner;        ///< its name in collisions
};

/// Every wall a ball can hit, in the order of the Partner numbers. A periodic box has none, a
/// planar one no z faces.
template <class Real>
std::vector<Wall<Real>> wallsOf(const Surroundings& surroundings) {
  std::vector<Wall<Real>> walls;
  if (!surroundings.periodic) {
    for (int axis = 0; axis < (surroundings.planar() ? 2 : 3); ++axis) {
      const VectorOf<Real> unit = VectorOf<Real>::Unit(axis);
      if (std::isfinite(surroundings.box.min[axis])) {
        walls.push_back({unit, Real(surroundings.box.min[axis]), boxFace(axis, false)});
      }
      if (std::isfinite(surroundings.box.max[axis])) {
        walls.push_back({-unit, -Real(surroundings.box.max[axis]), boxFace(axis, true)});
      }
    }
  }
  for (std::size_t k = 0; k < surroundings.planes.size(); ++k) {
    const Plane& plane = surroundings.planes[k];
    walls.push_back({plane.normal.cast<Real>(), Real(plane.offset), planePartner(k)});
  }
  return walls;
}

/// Below this share of its radius a ball's next bounce is not worth an event: it rests. The rest
/// of its bouncing would last 2 u/(g (1 - e)) with u = sqrt(2 g r 1e-14), about 1e-7 s.
constexpr double kRestingHeight = 1e-14;

/// Whether a ball that leaves a wall is back before it got anywhere.
/// @param speed  away from the wall, m/s
/// @param acceleration  along the inward normal, m/s^2
template <class Real>
bool comesToRest(Real speed, Real acceleration, Real radius) {
  return acceleration < 0 && speed * speed <= -2 * acceleration * (Real(kRestingHeight) * radius);
}

/// The walls a ball rests on, at most three: these hold it in place.
struct RestingContacts {
  static constexpr int kMost = 3;
  int count = 0;
  int walls[kMost] = {-1, -1, -1};  ///< indices into wallsOf()

  bool includes(int wall) const {
    for (int i = 0; i < count; ++i) {
      if (walls[i] == wall) return true;
    }
    return false;
  }
  void add(int wall) {
    if (count < kMost) walls[count++] = wall;
  }
  void removeAt(int i) { walls[i] = walls[--count]; }
};

/// Gravity less what the walls push back: the acceleration of a ball that rests on them. Of all
/// accelerations into none of the walls it is the one nearest to gravity (Gauss's principle of
/// least constraint): gravity itself, or along one wall, or along the edge of two, or none.
/// @param walls  all walls of the scene
/// @return m/s^2; into none of the contacts' walls
template <class Real>
VectorOf<Real> constrainedAcceleration(const VectorOf<Real>& gravity,
                                       const std::vector<Wall<Real>>& walls,
                                       const RestingContacts& contacts) {
  using std::sqrt;
  const auto normal = [&](int i) {
    return walls[static_cast<std::size_t>(contacts.walls[i])].normal;
  };
  const Real rounding = Real(1e-12) * sqrt(dot(gravity, gravity));
  VectorOf<Real> nearest = VectorOf<Real>::Zero();
  Real least = dot(gravity, gravity);
  const auto consider = [&](const VectorOf<Real>& a) {
    for (int i = 0; i < contacts.count; ++i) {
      if (dot(a, normal(i)) < -rounding) return;
    }
    const VectorOf<Real> constraint = a - gravity;
    const Real squared = dot(constraint, constraint);
    if (squared < least) {
      least = squared;
      nearest = a;
    }
  };
  consider(gravity);
  for (int i = 0; i < contacts.count; ++i) {
    const VectorOf<Real> n = normal(i);
    consider(gravity - dot(gravity, n) * n);
    for (int j = i + 1; j < contacts.count; ++j) {
      const VectorOf<Real> edge = n.cross(normal(j));
      const Real squared = dot(edge, edge);
      if (squared > 0) consider((dot(gravity, edge) / squared) * edge);
    }
  }
  return nearest;
}

/// The part of a velocity that runs along all of the contacts' walls.
/// @param v  m/s
template <class Real>
VectorOf<Real> velocityAlong(const VectorOf<Real>& v, const std::vector<Wall<Real>>& walls,
                             const RestingContacts& contacts) {
  const auto normal = [&](int i) {
    return walls[static_cast<std::size_t>(contacts.walls[i])].normal;
  };
  const Real parallel = Real(1e-9);  // of two unit vectors: nearer than any real wedge
  if (contacts.count == 0) return v;
  for (int i = 1; i < contacts.count; ++i) {
    const VectorOf<Real> edge = normal(0).cross(normal(i));
    const Real squared = dot(edge, edge);
    if (!(squared > parallel * parallel)) continue;
    for (int j = i + 1; j < contacts.count; ++j) {
      const Real out_of_edge = dot(edge, normal(j));
      if (out_of_edge * out_of_edge > parallel * parallel) return VectorOf<Real>::Zero();
    }
    return (dot(v, edge) / squared) * edge;
  }
  return v - dot(v, normal(0)) * normal(0);
}

/// What a change of its velocity does to a ball that rests on walls: it leaves those it moves away
/// from or into (into: the impact is still to come), and those that no longer press on it; along
/// the others it slides.
/// @param v  m/s; what is left across the walls rested on, less than a bounce, is taken out
/// @return the ball's acceleration from now on, m/s^2
template <class Real>
VectorOf<Real> settleContacts(RestingContacts& contacts, VectorOf<Real>& v, Real radius,
                              const VectorOf<Real>& gravity, const std::vector<Wall<Real>>& walls) {
  using std::sqrt;
  const auto normal = [&](int i) {
    return walls[static_cast<std::size_t>(contacts.walls[i])].normal;
  };
  const Real weight = sqrt(dot(gravity, gravity));
  for (int i = contacts.count - 1; i >= 0; --i) {
    if (!comesToRest<Real>(dot(v, normal(i)), -weight, radius)) contacts.removeAt(i);
  }
  VectorOf<Real> a = constrainedAcceleration<Real>(gravity, walls, contacts);
  for (int i = contacts.count - 1; i >= 0; --i) {
    if (dot(a, normal(i)) > Real(1e-12) * weight) contacts.removeAt(i);
  }
  v = velocityAlong<Real>(v, walls, contacts);
  return a;
}

}  // namespace ball_sim::core
