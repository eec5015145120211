// What a single ball must be to be let in, whoever asks: a scene file, a service, a program.
#pragma once

#include "ball_sim/ball.hpp"
#include "ball_sim/refusal.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// Checks all that concerns one ball and what stands around it; other balls are not looked at.
/// Finite and within limits.hpp; mass > 0 or +infinity, and then at rest; inside every closed box
/// face and plane (to kTouchSlack of its radius, or to rounding far from the origin); in the plane
/// of a planar scene, bit for bit; in a periodic box no larger than the box.
/// @return the first rule broken, as a sentence that begins with the name of the field
Refusal checkBall(const Ball& ball, const Surroundings& surroundings);

/// Checks a place and radius alone; see checkBall.
Refusal checkPlace(const Vector3& position, double radius, const Surroundings& surroundings);

/// Checks a velocity alone; see checkBall.
Refusal checkVelocity(const Vector3& velocity, const Surroundings& surroundings);

/// The same place inside a periodic box, [min, max) per axis; elsewhere, and when already inside,
/// `position` bit for bit.
Vector3 wrapped(const Vector3& position, const Surroundings& surroundings);

/// From a to b by the shortest way, m: through a face where the box is periodic.
Vector3 separation(const Vector3& a, const Vector3& b, const Surroundings& surroundings);

/// Whether two balls overlap; touching to kTouchSlack of the sum of radii is no overlap.
/// @param between  from one centre to the other, m
/// @param reach    sum of the radii, m
bool overlapping(const Vector3& between, double reach);

/// "overlaps <other>: centres 0.05 m apart, radii sum to 0.1 m".
std::string overlapText(const std::string& other, double distance, double reach);

}  // namespace ball_sim::core
