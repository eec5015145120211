// Other engines behind one interface. One file an engine; each says at its head how it is set, and
// why. All are set for smooth balls that bounce with the scene's restitution: no friction, no spin,
// no damping, no sleep, no least speed of a bounce.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"
#include "trajectory.hpp"

namespace ball_sim::core::chart {

/// An engine that holds balls, walls and gravity.
class Peer {
 public:
  virtual ~Peer() = default;

  /// Goes on by steps of the length it was made with.
  virtual void advance(std::uint64_t steps) = 0;

  /// All balls, ids from 0.
  virtual void read(BallStates& states) = 0;

  /// Appends who touched in the last step, in any order, repeats allowed.
  virtual void touching(std::vector<Impact>& pairs) = 0;
};

// @param step  s
std::unique_ptr<Peer> makeBullet(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                 double step);
std::unique_ptr<Peer> makeOde(const Surroundings& surroundings, const std::vector<Ball>& balls,
                              double step);
std::unique_ptr<Peer> makeBox2d(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                double step);
std::unique_ptr<Peer> makeChipmunk(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                   double step);
std::unique_ptr<Peer> makeMujoco(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                 double step);
std::unique_ptr<Peer> makeLammps(const Surroundings& surroundings, const std::vector<Ball>& balls,
                                 double step);

/// Room for so many balls. The engines count no time of their own.
void resize(BallStates& states, std::size_t count);

}  // namespace ball_sim::core::chart
