// The interface behind which every method of moving balls stands.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/ball.hpp"
#include "ball_sim/surroundings.hpp"

namespace ball_sim::core {

/// One impact, as it happened.
struct Collision {
  Time time;
  BallId a = 0;
  Partner b = 0;                     ///< the other ball, or a wall (see Partner)
  Vector3 point = Vector3::Zero();   ///< point of contact, m
  Vector3 normal = Vector3::Zero();  ///< unit, from a towards b
  double impulse = 0;                ///< N s, >= 0; a gets -impulse * normal
  double approach_speed = 0;         ///< m/s along the normal, just before, >= 0
};

/// Collects collisions up to a bound and counts the rest; a reader empties it.
struct CollisionLog {
  std::vector<Collision> entries;
  std::size_t capacity = std::numeric_limits<std::size_t>::max();
  std::uint64_t dropped = 0;

  void add(const Collision& collision) {
    if (entries.size() < capacity) {
      entries.push_back(collision);
    } else {
      ++dropped;
    }
  }
};

/// What a method counted since it began.
struct Statistics {
  std::uint64_t ball_collisions = 0;
  std::uint64_t wall_collisions = 0;  ///< box faces and planes
  std::uint64_t events = 0;  ///< every event handled: collisions, cell crossings, stale ones, ...
  double virial = 0;         ///< J: sum over ball-ball impacts of impulse times distance of centres
  double deepest_overlap = 0;   ///< m: deepest overlap seen at any impact
  double elastic_energy = 0;    ///< J: held by the springs of soft contacts now
  std::size_t queue_depth = 0;  ///< events that wait
  std::size_t bytes = 0;        ///< memory held for balls, cells and queue
  /// Impacts at one instant whose outcome the policy (SimultaneousImpacts) decided; without those
  /// of contacts that come to rest, see settles().
  std::uint64_t ambiguous_impacts = 0;
};

/// Moves a set of balls. Inputs are valid by contract: World checks what users give.
///
/// A method owns its state and is deterministic: the same calls give the same bits. Reading never
/// changes a trajectory.
class Method {
 public:
  virtual ~Method() = default;

  /// The method's name as scenes spell it.
  virtual const char* name() const = 0;

  /// Why it is this one that moves the balls.
  virtual std::string reason() const { return "asked for"; }

  /// Adds a ball at the present instant.
  /// @param id    not in use, and larger than all ids before it
  /// @param ball  finite, overlaps none, within the surroundings; in a periodic box anywhere
  virtual void insert(BallId id, const Ball& ball) = 0;

  /// Takes a ball out. @param id in use
  virtual void remove(BallId id) = 0;

  /// Puts a ball somewhere else and gives it a velocity, now. @param id in use, not fixed
  virtual void setMotion(BallId id, const Vector3& position, const Vector3& velocity) = 0;

  /// Gives a ball a velocity, now, without touching its place. @param id in use, not fixed
  virtual void setVelocity(BallId id, const Vector3& velocity) = 0;

  /// Handles all that happens up to `target`, in order of time, `target` included.
  /// @param target      not before now()
  /// @param max_events  stops early after this many events; call again to go on
  /// @return true when `target` was reached
  virtual bool advanceTo(Time target, std::uint64_t max_events) = 0;
  bool advanceTo(Time target) {
    return advanceTo(target, std::numeric_limits<std::uint64_t>::max());
  }

  /// The instant reached.
  virtual Time now() const = 0;

  /// Writes every ball's place and velocity at now(); reuses the vectors' memory.
  virtual void read(BallStates& states) const = 0;

  /// One ball at now(). @param id in use
  virtual Ball ball(BallId id) const = 0;

  /// The smallest id of a ball that a ball at `position` with `radius` would overlap now.
  /// Touching (to 1e-12 of the sum of radii) is no overlap.
  /// @param ignore a ball left out of the search
  virtual std::optional<BallId> findOverlap(const Vector3& position, double radius,
                                            std::optional<BallId> ignore) const = 0;

  virtual Statistics statistics() const = 0;

  /// What the run asked of the method beyond its limits so far, as a sentence that names the limit
  /// and the remedy; empty: nothing. What is beyond a limit for good makeMethod() refuses.
  virtual std::string warning() const { return {}; }

  /// Reports each impact from now on; nullptr: none. The log must outlive the method or the call
  /// that takes it away.
  virtual void setCollisionLog(CollisionLog* log) = 0;
};

}  // namespace ball_sim::core
