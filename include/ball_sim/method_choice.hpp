// Which method a scene is for: estimates from its numbers, and the rule that `auto` follows.
//
// What keeps a tolerance on trajectories are the exact methods, and among them the cheaper one is
// taken: by the rate of collisions of a fluid (Enskog), the rate at which balls cross cells, and
// measured costs of both. A stepping method is off by the order of a step at every impact, which
// chaos multiplies from impact to impact: it keeps a tolerance over no more than a few, and costs
// more. Its place is a pile at rest, which an exact method could only hum through impact by impact
// (collapse_guard.hpp); whether a pile has formed the run itself shows, see auto_method.hpp.
//
// Chaos bounds what any method can do: an error of rounding doubles with every collision or so, and
// after the horizon it is as large as the tolerance. Beyond it a computed trajectory is one of many
// that the scene could as well take; what is conserved, and statistics, stay right.
//
// Limits: estimates assume a fluid that has mixed; those of few balls, of crystals and of balls in
// open space are rough. Costs hold for one machine, their ratios for most.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/methods.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// What the choice depends on.
struct SceneNumbers {
  std::size_t balls = 0;  ///< that can move
  bool planar = false;
  bool settles = false;         ///< balls fall, lose speed at impacts, and have something to lie on
  double volume = 0;            ///< m^3 (planar: m^2), of the box, or of what the balls span
  double packing_fraction = 0;  ///< planar: area fraction; fixed balls included
  double mean_radius = 0;       ///< m, of those that can move
  double smallest_radius = 0;   ///< m
  double mean_speed = 0;        ///< m/s, relative to the common motion, and after a fall
  double collision_rate = 0;    ///< 1/s, ball-ball collisions of a ball; each counts for both
  double bits_per_collision = 0;  ///< by which errors grow while a ball has a collision, of the
                                  ///< size of balls whose errors grow fastest
  double crowd = 0;  ///< balls in a cube (planar: square) as wide as a ball, mean over collisions:
                     ///< large balls among small ones, for whose impacts many are searched

  /// Whether there is no fluid to speak of; and any method takes no time.
  bool areFew() const { return balls < 32; }
};

// Measured by bench/auto_benchmark in piles of 300 balls when they have just formed, s of CPU time:
// an event of event_driven, and a step of a ball of discrete. Both are a quarter of it in a stack
// of 10.
constexpr double kCostOfEvent = 2e-6;
constexpr double kCostOfStep = 0.7e-6;

/// Collision rate of a mixed fluid of hard balls by Enskog's theory, for any radii, masses and
/// speeds: rate_ij = n_j chi_ij pi s_ij^2 g_ij for spheres, n_j chi_ij 2 s_ij g_ij for discs, s_ij
/// the sum of radii, g_ij the mean relative speed, chi_ij the pair correlation at contact (spheres:
/// Boublik 1970 and Mansoori et al. 1971; discs: Jenkins, Mancini 1987).
/// @param balls  fixed ones are hit, but do not count
/// @param volume m^3 (planar: m^2), > 0
/// @return 1/s, mean over the balls that can move
/// Limits: the fluid; at a packing fraction of 0.45 (planar: 0.6) a few percent low.
double enskogCollisionRate(const std::vector<Ball>& balls, double volume, bool planar);

/// When trajectories are beyond the horizon, s; +infinity: nothing collides.
double horizonInSeconds(const SceneNumbers& numbers, double tolerance);

/// Bits by which the distance of two trajectories grows per collision of a ball, in an equilibrated
/// fluid of equal balls; measured by time reversal, and interpolated in the logarithm of the mean
/// free path.
/// @param packing_fraction  0..1 (planar: area fraction)
double chaosBits(double packing_fraction, bool planar);

/// How many collisions a ball lives through before the rounding of doubles has grown to an error.
/// @param tolerance  of a radius, > 0
/// @return collisions per ball, >= 0
double horizonInCollisions(double bits_per_collision, double tolerance);

/// The error that ends a trajectory's use where a scene names no tolerance, of a radius.
constexpr double kVisibleError = 1e-2;

/// The methods that `auto` may choose from: all, or those that can take impacts together.
std::vector<std::string> methodsThatKeep(SimultaneousImpacts policy);

SceneNumbers sceneNumbers(const Surroundings& surroundings, const std::vector<Ball>& balls);

/// CPU time of a simulated second, s, by costs measured on gases and fluids of 10^3 to 10^5 spheres
/// in a closed box (Xeon with 2 MiB of L2 a core): an impact costs so much, and so does the way of
/// a ball to where its neighbours were; both cost more where the balls do not fit into the cache.
/// An impact of a large ball among small ones costs event_driven more, by the balls it has around
/// it. Mostly within 10 % of what was measured for those, and 40 % at worst; a factor of 2 for
/// discs.
/// @param method  an exact method
/// @return nothing for a method whose cost is not known
std::optional<double> estimatedCost(const std::string& method, const SceneNumbers& numbers);

/// The cheapest exact method, and the numbers it was chosen by.
/// @param known  names of methods that there are
MethodChoice chooseFor(const SceneNumbers& numbers, std::optional<double> tolerance,
                       const std::vector<std::string>& known);

}  // namespace ball_sim::core
