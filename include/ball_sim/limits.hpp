// The largest and smallest numbers a user may give.
//
// They are far beyond any use, and near enough to 1 that no square, nor a product of two squares,
// overflows or vanishes in double precision (1e-308..1e308).
#pragma once

namespace ball_sim::core {

constexpr double kMaxCoordinate = 1e9;    ///< m, magnitude of any coordinate of a place or wall
constexpr double kMaxSpeed = 1e9;         ///< m/s, magnitude of any component of a velocity
constexpr double kMaxAcceleration = 1e9;  ///< m/s^2, magnitude of any component of gravity
constexpr double kMinRadius = 1e-30;      ///< m
constexpr double kMaxRadius = 1e9;        ///< m
constexpr double kMinMass = 1e-60;        ///< kg
constexpr double kMaxMass = 1e60;         ///< kg, of a ball that is not fixed
constexpr double kMaxTime = 1e15;         ///< s, the latest date a run may ask for

/// Share of a radius (or of a sum of radii) by which rounding may put a ball into a wall (or into
/// another ball) and still be called touching.
constexpr double kTouchSlack = 1e-12;

}  // namespace ball_sim::core
