// The world: balls, their surroundings and the method that moves them, behind one checked door.
//
// Everything a user can ask of a running simulation goes through here. What cannot be done is
// refused with a reason a person can act on, and then nothing has changed. Methods below rely on
// these checks and do none of their own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/method.hpp"
#include "ball_sim/methods.hpp"
#include "ball_sim/refusal.hpp"
#include "ball_sim/scene.hpp"

namespace ball_sim::core {

/// What became of a request to add balls: all of them, or none.
struct SpawnResult {
  std::vector<BallId> ids;        ///< one a ball when all were accepted, else empty
  std::vector<Refusal> refusals;  ///< one a ball, in order

  bool accepted() const { return ids.size() == refusals.size(); }
};

struct WorldOptions {
  std::string method;               ///< overrides the scene's; empty: the scene's
  std::optional<double> time_step;  ///< s, overrides the scene's
  std::optional<double> tolerance;  ///< of a radius, 0..1, overrides the scene's
  Precision precision = Precision::double_precision;
  unsigned threads = 1;  ///< >= 1, for the methods that can share their work
  std::size_t max_balls = 10'000'000;
};

class World {
 public:
  /// Fills the scene and sets the clock to 0.
  /// @throws PackingError, std::invalid_argument (method, time step, tolerance), Refused (a listed
  /// ball, named by index; more balls than max_balls)
  explicit World(const Scene& scene, const WorldOptions& options = {});

  // --- time

  Time now() const { return method_->now(); }

  /// Moves on to `target`.
  /// @param target      not before now()
  /// @param max_events  stops early after this many events
  /// @return true when `target` was reached; false: call again to go on
  /// @throws std::invalid_argument  `target` in the past, or beyond kMaxTime
  bool advanceTo(Time target, std::uint64_t max_events = std::numeric_limits<std::uint64_t>::max());

  // --- balls: read

  std::size_t size() const { return ids_.size(); }
  const std::vector<BallId>& ids() const { return ids_; }        ///< ascending
  const std::vector<double>& radii() const { return radii_; }    ///< m, in the order of ids()
  const std::vector<double>& masses() const { return masses_; }  ///< kg, in the order of ids()
  bool contains(BallId id) const;
  Ball ball(BallId id) const;  ///< @throws Refused unknown id
  void read(BallStates& states) const { method_->read(states); }

  // --- balls: change, at now()

  /// Adds all the balls or none. In a periodic box a place outside is wrapped to the inside.
  SpawnResult spawn(const std::vector<Ball>& balls);

  /// Adds one. @throws Refused
  BallId spawn(const Ball& ball);

  /// Takes out all of `ids` or none; a repeated id counts once. @throws Refused naming unknown ids
  void remove(const std::vector<BallId>& ids);
  void removeAll();

  /// Takes out what was added since the scene was loaded.
  void removeSpawned();

  struct VelocityChange {
    Vector3 before;  ///< m/s
    Vector3 after;   ///< m/s
  };

  /// @param impulse N s. @return the velocity before and after, m/s. @throws Refused
  VelocityChange applyImpulse(BallId id, const Vector3& impulse);

  /// Puts a ball elsewhere (checked as for spawn) and sets its velocity. @throws Refused
  void setMotion(BallId id, const Vector3& position, const Vector3& velocity);

  /// Everything as the scene has it, ids included; time goes on from now(), or begins at 0 again.
  /// Statistics begin again. When time goes on, a ball spawned later never gets an id that was in
  /// use before; when it begins again, so do the ids: it is a new run.
  void reset(bool restart_time);

  // --- what it is, and how it goes

  const Scene& scene() const { return scene_; }  ///< with box extents filled in
  const Surroundings& surroundings() const { return scene_.surroundings; }
  /// The method at work now, and why; `auto` may change it as time goes on.
  MethodChoice method() const { return {method_->name(), method_->reason()}; }
  Statistics statistics() const { return method_->statistics(); }
  std::string warning() const { return method_->warning(); }  ///< see Method::warning()
  double kineticEnergy() const;                               ///< J
  double potentialEnergy() const;  ///< J, of gravity and of soft contacts
  Vector3 momentum() const;        ///< kg m/s

  /// Reports impacts into `log` from now on, across resets; nullptr: none.
  void setCollisionLog(CollisionLog* log);

 private:
  std::size_t indexOf(BallId id) const;  // throws Refused
  // What checkBall says, then overlap with a ball of the world other than `itself`.
  Refusal check(const Ball& ball, std::optional<BallId> itself) const;
  void add(BallId id, const Ball& ball);
  void takeOut(const std::vector<BallId>& ids);
  void build(Time start);

  Scene scene_;
  WorldOptions options_;
  MethodChoice choice_;        // of the start
  std::vector<Ball> initial_;  // the scene's balls, in order of id
  std::unique_ptr<Method> method_;
  std::vector<BallId> ids_;
  std::vector<double> radii_;   // m
  std::vector<double> masses_;  // kg
  BallId next_id_ = 0;
  CollisionLog* log_ = nullptr;
};

}  // namespace ball_sim::core
