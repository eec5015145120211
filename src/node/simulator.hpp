// Runs a world against the wall clock and publishes what happens.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "ball_sim/world.hpp"
#include "command_queue.hpp"
#include "grid.hpp"
#include "outputs.hpp"
#include "parameters.hpp"
#include "viewer_wait.hpp"

namespace ball_sim {

/// An event that comes back after a period of wall time.
class Periodic {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param rate  Hz, > 0, or 0: never
  explicit Periodic(double rate);

  /// Whether it is time; if so, the next time is a period later. Missed ones are not made up for.
  bool due(Clock::time_point now);

  /// Makes the next time `now` plus `wait`.
  void postpone(Clock::time_point now, Clock::duration wait) { next_ = now + wait; }

  Clock::duration period() const { return period_; }

 private:
  Clock::duration period_;
  Clock::time_point next_;
};

/// The owner of the world, and of the thread it lives in.
///
/// Frames begin on a schedule of steady wall time, 1 / clock_rate apart, and advance simulated time
/// by real_time_factor / clock_rate. When a frame takes longer, simulated time falls behind for
/// good: rates per simulated second hold, and no burst follows. Time is held in whole nanoseconds
/// wherever something from outside may act or look, so that a stamp names an instant exactly.
///
/// All public functions but commands() are for the world's thread: for run(), and for work that it
/// takes from commands().
class Simulator {
 public:
  using Clock = CommandQueue::Clock;

  /// @param stop  asked often; true ends run() and step()
  Simulator(const Parameters& parameters, core::World& world, Outputs& outputs,
            std::function<bool()> stop);

  /// Runs until stopped. Commands that still wait then are for the owner of commands() to close.
  void run();

  CommandQueue& commands() { return commands_; }
  core::World& world() { return world_; }

  /// Simulated time, ns.
  std::int64_t now() const { return now_; }

  /// ROS time of simulated time 0, ns.
  std::int64_t start() const { return start_; }

  /// ROS time.
  ros::Time stamp() const;

  bool paused() const { return paused_; }

  /// Ends the wait for a viewer too: who asks knows better when to start.
  void setPaused(bool paused);

  /// Must follow every change to the world's balls from outside.
  /// @param population  whether balls came or went
  void noteChange(bool population);

  /// Runs on as fast as it can. The wait for a viewer ends: what follows is pause.
  /// @param target  simulated time, ns. @return false: stopped early, at now()
  bool step(std::int64_t target, Clock::time_point deadline);

  /// Simulated time of the `count`-th instant of ~ball_states from now, ns. @param count  >= 1
  std::int64_t stateInstant(std::int64_t count) const { return states_.after(now_, count); }

  /// The scene as it was loaded; see World::reset().
  void reset(bool restart_time);

 private:
  bool advance(std::int64_t target);
  bool moveTo(std::int64_t target);
  bool settled() const;
  void serveCommands();
  void awaitViewer();
  void finishCommands();
  void waitForNextFrame();
  void publishFrame(bool frame_ended);
  void publishStates();
  void listen();
  void tellNews();
  static void warnOnce(const std::string& warning, bool& warned);
  SimStats stats(Clock::time_point wall);
  double energy() const { return world_.kineticEnergy() + world_.potentialEnergy(); }

  const Parameters parameters_;
  core::World& world_;
  Outputs& outputs_;
  const std::function<bool()> stop_;
  CommandQueue commands_;
  core::CollisionLog collisions_;
  bool listening_ = false;  // whether the world reports into collisions_

  // Simulated time.
  const std::int64_t start_;               // ns
  std::int64_t now_ = 0;                   // ns
  const Grid frames_;                      // frames end here
  const Grid states_;                      // ~ball_states, and whole steps
  bool paused_;                            // also while waiting for a viewer
  std::optional<ViewerWait> viewer_wait_;  // begun, and not over

  // Wall time.
  Clock::time_point next_frame_;
  Periodic clock_due_;
  Periodic markers_due_;
  Periodic still_markers_due_{1};  // for who joins while nothing moves
  Periodic stats_due_{2};
  Periodic repeat_due_{0.2};

  // What is still to be told.
  bool moved_ = true;       // since the markers before
  bool changed_ = true;     // from outside
  bool population_ = true;  // changed from outside
  std::string method_;      // the one last told of
  bool warned_of_policy_ = false;
  bool warned_of_method_ = false;

  // For ~stats.
  double reference_energy_ = 0;  // J, after the last change from outside
  std::uint64_t late_frames_ = 0;
  std::uint64_t dropped_collisions_ = 0;
  Clock::time_point stats_wall_;  // of the message before
  std::int64_t stats_time_ = 0;   // ns, simulated
  std::uint64_t stats_events_ = 0;
};

}  // namespace ball_sim
