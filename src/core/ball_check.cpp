// What a single ball must be to be let in, whoever asks.
#include "ball_sim/ball_check.hpp"

#include <cmath>
#include <cstdio>
#include <limits>

#include "ball_sim/limits.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim::core {
namespace {

constexpr const char* kAxisNames[] = {"x", "y", "z"};

Refusal refusal(RefusalCode code, const std::string& reason) { return {code, reason}; }

bool finite(const Vector3& v) {
  return std::isfinite(v.x()) && std::isfinite(v.y()) && std::isfinite(v.z());
}

// Components finite and at most `limit` in magnitude.
Refusal checkComponents(const std::string& name, const Vector3& value, double limit,
                        const std::string& unit) {
  if (!finite(value)) {
    return refusal(RefusalCode::not_finite,
                   name + " is " + formatVector(value) + ": must be three finite numbers");
  }
  if (value.cwiseAbs().maxCoeff() > limit) {
    return refusal(RefusalCode::out_of_range, name + " is " + formatVector(value) + " " + unit +
                                                  ": no component may exceed " +
                                                  formatNumber(limit) + " " + unit);
  }
  return {};
}

// `name` is within [lower, upper].
Refusal checkScalar(const std::string& name, double value, double lower, double upper,
                    const std::string& unit) {
  if (!std::isfinite(value)) {
    return refusal(RefusalCode::not_finite,
                   name + " is " + formatNumber(value) + ": must be a finite number above 0");
  }
  if (value <= 0) {
    return refusal(RefusalCode::out_of_range,
                   name + " is " + formatNumber(value) + " " + unit + ": must be above 0");
  }
  if (value < lower || value > upper) {
    return refusal(RefusalCode::out_of_range, name + " is " + formatNumber(value) + " " + unit +
                                                  ": must be within " + formatNumber(lower) + ".." +
                                                  formatNumber(upper) + " " + unit);
  }
  return {};
}

// How far a ball of `radius` may stick out past a wall at distance `magnitude` from the origin:
// kTouchSlack of the radius, and what rounding of a coordinate of that magnitude amounts to.
double wallSlack(double radius, double magnitude) {
  return kTouchSlack * radius + 2 * std::numeric_limits<double>::epsilon() * magnitude;
}

Refusal sticksOut(const std::string& wall, double depth) {
  char metres[32];
  std::snprintf(metres, sizeof metres, "%.6g", depth);  // a difference: its last digits are noise
  return refusal(
      RefusalCode::outside,
      std::string("position puts the ball outside: it sticks out ") + metres + " m beyond " + wall);
}

Refusal checkBox(const Vector3& position, double radius, const Surroundings& surroundings) {
  const Box& box = surroundings.box;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == 2 && surroundings.planar()) break;
    const std::string name = kAxisNames[axis];
    const double x = position[axis];
    const double lower = box.min[axis];
    const double upper = box.max[axis];
    if (surroundings.periodic) {
      if (2 * radius > upper - lower) {
        return refusal(RefusalCode::outside, "radius is " + formatNumber(radius) +
                                                 " m: the ball is wider than the periodic box, " +
                                                 formatNumber(upper - lower) + " m along " + name);
      }
      continue;
    }
    if (std::isfinite(lower) && x - radius < lower - wallSlack(radius, std::abs(lower) + radius)) {
      return sticksOut("the box's " + name + "-min face, " + name + " = " + formatNumber(lower),
                       lower - (x - radius));
    }
    if (std::isfinite(upper) && x + radius > upper + wallSlack(radius, std::abs(upper) + radius)) {
      return sticksOut("the box's " + name + "-max face, " + name + " = " + formatNumber(upper),
                       x + radius - upper);
    }
  }
  return {};
}

Refusal checkPlanes(const Vector3& position, double radius, const Surroundings& surroundings) {
  for (std::size_t i = 0; i < surroundings.planes.size(); ++i) {
    const Plane& plane = surroundings.planes[i];
    const double distance = dot(plane.normal, position) - plane.offset;
    const double magnitude = position.cwiseAbs().sum() + std::abs(plane.offset);
    if (distance < radius - wallSlack(radius, magnitude)) {
      return sticksOut("plane " + std::to_string(i), radius - distance);
    }
  }
  return {};
}

}  // namespace

Refusal checkPlace(const Vector3& position, double radius, const Surroundings& surroundings) {
  if (Refusal r = checkComponents("position", position, kMaxCoordinate, "m")) return r;
  if (Refusal r = checkScalar("radius", radius, kMinRadius, kMaxRadius, "m")) return r;
  const double height = surroundings.box.min.z();
  if (surroundings.planar() && position.z() != height) {
    return refusal(RefusalCode::not_planar, "position is " + formatVector(position) +
                                                " m: the scene is planar, z must be " +
                                                formatNumber(height) + " m");
  }
  if (Refusal r = checkBox(position, radius, surroundings)) return r;
  return checkPlanes(position, radius, surroundings);
}

Refusal checkVelocity(const Vector3& velocity, const Surroundings& surroundings) {
  if (Refusal r = checkComponents("velocity", velocity, kMaxSpeed, "m/s")) return r;
  if (surroundings.planar() && velocity.z() != 0) {
    return refusal(RefusalCode::not_planar,
                   "velocity is " + formatVector(velocity) +
                       " m/s: the scene is planar, its z component must be 0");
  }
  return {};
}

Refusal checkBall(const Ball& ball, const Surroundings& surroundings) {
  const bool fixed = ball.mass == std::numeric_limits<double>::infinity();
  if (!fixed) {
    if (Refusal r = checkScalar("mass", ball.mass, kMinMass, kMaxMass, "kg")) return r;
  }
  if (Refusal r = checkPlace(ball.position, ball.radius, surroundings)) return r;
  if (Refusal r = checkVelocity(ball.velocity, surroundings)) return r;
  if (fixed && ball.velocity != Vector3::Zero()) {
    return refusal(RefusalCode::fixed_ball,
                   "velocity is " + formatVector(ball.velocity) +
                       " m/s: a ball of infinite mass is fixed, its velocity must be 0");
  }
  return {};
}

Vector3 wrapped(const Vector3& position, const Surroundings& surroundings) {
  if (!surroundings.periodic) return position;
  const Box& box = surroundings.box;
  Vector3 inside = position;
  const int axes = surroundings.planar() ? 2 : 3;
  for (int axis = 0; axis < axes; ++axis) {
    const double lower = box.min[axis];
    const double length = box.max[axis] - lower;
    double& x = inside[axis];
    if (x >= lower && x < box.max[axis]) continue;
    x -= length * std::floor((x - lower) / length);
    // Rounding can leave x just below min or at max: both are the same face.
    if (x < lower || x >= box.max[axis]) x = lower;
  }
  return inside;
}

Vector3 separation(const Vector3& a, const Vector3& b, const Surroundings& surroundings) {
  Vector3 between = b - a;
  if (!surroundings.periodic) return between;
  const int axes = surroundings.planar() ? 2 : 3;
  for (int axis = 0; axis < axes; ++axis) {
    const double length = surroundings.box.max[axis] - surroundings.box.min[axis];
    between[axis] -= length * std::nearbyint(between[axis] / length);
  }
  return between;
}

bool overlapping(const Vector3& between, double reach) {
  const double touching = reach * (1 - kTouchSlack);
  return dot(between, between) < touching * touching;
}

std::string overlapText(const std::string& other, double distance, double reach) {
  char text[128];
  std::snprintf(text, sizeof text, ": centres %.6g m apart, radii sum to %.6g m", distance, reach);
  // Rounded alike, the two would not tell why: then all digits.
  if (reach - distance < 1e-5 * reach) {
    std::snprintf(text, sizeof text, ": centres %.17g m apart, radii sum to %.17g m", distance,
                  reach);
  }
  return "overlaps " + other + text;
}

}  // namespace ball_sim::core
