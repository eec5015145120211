// Keeps the number of impacts finite where inelastic hard balls would have infinitely many.
//
// Three balls in a row with e < 7 - 4 sqrt(3) collide infinitely often in finite time (McNamara,
// Young, "Inelastic collapse and clumping in a one-dimensional granular medium", 1992). The TC
// model (Luding, McNamara, "How to handle the inelastic collapse of a dissipative hard-sphere gas",
// 1998) makes an impact elastic when a partner's last one is younger than a contact time t_c.
// Here the contact time is not a constant but a distance: an impact is quick when the partners came
// less than 1e-6 of their sum of radii closer since the last impact of either. And only a ball with
// a run of quick impacts is treated so: a cradle or a rack of touching balls, where a few impacts
// follow at one instant, keeps its restitution.
//
// Once the speeds along the normals are down to the rounding of the speeds across them, the
// collision law parts the partners by a few ulps, and that is the end of it.
//
// A ball that lies on a fixed or resting ball is the other case: there the floor under the rebound
// speed keeps it humming within 1e-6 of the sum of radii instead of stopping the clock.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace ball_sim::core {

constexpr double kQuickDistance = 1e-6;        ///< of the sum of radii
constexpr std::uint32_t kLongestCascade = 64;  ///< a longer run of quick impacts is a collapse
constexpr double kHumHeight = 1e-6;            ///< of the sum of radii

/// What a ball remembers of its impacts.
template <class Real>
struct ImpactHistory {
  Real last = -std::numeric_limits<Real>::infinity();  ///< s, time of the last impact
  std::uint32_t quick = 0;                             ///< length of the present run of quick ones

  /// Records an impact and says whether the ball is in a collapse, so that the impact is elastic.
  /// @param now  s, on the clock of `last`
  /// @param approach_speed  m/s, >= 0
  /// @param reach  m, sum of the radii, or the radius at a wall
  bool record(Real now, Real approach_speed, Real reach) {
    const bool is_quick = (now - last) * approach_speed < Real(kQuickDistance) * reach;
    quick = is_quick ? std::min(quick + 1, kLongestCascade) : 0;
    last = now;
    return quick == kLongestCascade;
  }
};

/// Least speed at which two balls part that their accelerations press together, m/s.
/// @param pressing  m/s^2, relative acceleration towards each other; <= 0: none, and the result 0
template <class Real>
Real leastRebound(Real pressing, Real reach) {
  using std::sqrt;
  return pressing > 0 ? sqrt(2 * pressing * (Real(kHumHeight) * reach)) : Real(0);
}

}  // namespace ball_sim::core
