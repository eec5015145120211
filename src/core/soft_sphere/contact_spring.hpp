// The linear spring and dashpot between soft balls, and how stiff a scene needs them.
#pragma once

#include <optional>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// Relative motion of two partners in contact: overlap'' + damping overlap' + stiffness overlap =
/// 0. Per reduced mass, so that all pairs are in contact equally long.
struct ContactSpring {
  double stiffness = 0;  ///< 1/s^2; times the reduced mass: the spring constant, N/m
  double damping = 0;    ///< 1/s; times the reduced mass: the dashpot's, N s/m
};

/// Below this restitution a contact would all but stick; a smaller one is taken as this.
constexpr double kLeastRestitution = 0.01;

/// The spring whose contacts last `contact_time` and keep `restitution` of the approach speed: with
/// b = -ln e / t_c, stiffness (pi/t_c)^2 + b^2 and damping 2 b.
/// @param contact_time  t_c, s, > 0
/// @param restitution   e, 0..1
/// Limits: the contact ends where the overlap does, so a strong dashpot pulls a little before.
/// Source: Schaefer, Dippel, Wolf, "Force schemes in simulations of granular materials", 1996,
/// section 3; Luding, "Collisions and contacts between two particles", 1998.
ContactSpring contactSpring(double contact_time, double restitution);

/// The contact time at which the hardest impact that a scene has at first overlaps by `tolerance`
/// of the smallest radius r: t_c = pi tolerance r / u, since at e = 1 an impact at speed u overlaps
/// by u t_c / pi (Schaefer, Dippel, Wolf 1996). u is that of two of the fastest balls head-on,
/// after the farthest fall there is.
/// @param tolerance  > 0
/// @return s; nothing when no ball moves and none falls
std::optional<double> contactTimeFor(double tolerance, const std::vector<Ball>& balls,
                                     const Surroundings& surroundings);

}  // namespace ball_sim::core
