#include "simulator.hpp"

#include <ros/console.h>

#include <algorithm>

#include "ball_sim/warnings.hpp"
#include "conversions.hpp"

namespace ball_sim {
namespace {

using WallClock = std::chrono::steady_clock;

WallClock::duration seconds(double value) {
  return std::chrono::duration_cast<WallClock::duration>(std::chrono::duration<double>(value));
}

/// @return how many frames there are in a second of simulated time
double frameRate(const Parameters& parameters) {
  const double factor = parameters.real_time_factor;
  return factor > 0 ? parameters.clock_rate / factor : parameters.clock_rate;
}

/// @return Hz of the grid for ~ball_states; without them it still serves whole steps
double stateRate(const Parameters& parameters) {
  return parameters.state_rate > 0 ? parameters.state_rate : Parameters().state_rate;
}

}  // namespace

Periodic::Periodic(double rate)
    : period_(rate > 0 ? seconds(1 / rate) : Clock::duration::max()),
      next_(rate > 0 ? Clock::now() : Clock::time_point::max()) {}

bool Periodic::due(Clock::time_point now) {
  if (now < next_) {
    return false;
  }
  next_ = std::max(next_ + period_, now);
  return true;
}

Simulator::Simulator(const Parameters& parameters, core::World& world, Outputs& outputs,
                     std::function<bool()> stop)
    : parameters_(parameters),
      world_(world),
      outputs_(outputs),
      stop_(std::move(stop)),
      start_(toNanoseconds(parameters.start_time)),
      frames_(frameRate(parameters)),
      states_(stateRate(parameters)),
      paused_(parameters.start_paused),
      clock_due_(parameters.clock_rate),
      markers_due_(parameters.marker_rate),
      method_(world.method().name) {
  collisions_.capacity = Outputs::kMaxCollisions;
  if (parameters.wait_for_viewer > 0 && !paused_) {
    viewer_wait_.emplace(outputs.markersTopic(), parameters.wait_for_viewer);
    paused_ = true;
  }
}

void Simulator::run() {
  next_frame_ = stats_wall_ = Clock::now();
  outputs_.publishSceneMarkers(world_);
  finishCommands();
  publishStates();
  while (!stop_()) {
    serveCommands();
    awaitViewer();
    const bool frame_ended = paused_ || advance(frames_.after(now_));
    publishFrame(frame_ended);
    if (frame_ended) {
      waitForNextFrame();
    }
  }
}

ros::Time Simulator::stamp() const { return toStamp(start_ + now_); }

void Simulator::setPaused(bool paused) {
  viewer_wait_.reset();
  paused_ = paused;
}

void Simulator::noteChange(bool population) {
  changed_ = true;
  population_ = population_ || population;
}

bool Simulator::step(std::int64_t target, Clock::time_point deadline) {
  viewer_wait_.reset();
  while (now_ < target) {
    if (stop_() || Clock::now() > deadline) {
      break;
    }
    advance(std::min(target, frames_.after(now_)));
    publishFrame(false);
  }
  return now_ >= target;
}

void Simulator::reset(bool restart_time) {
  commands_.withdrawTimed();
  world_.reset(restart_time);
  collisions_.entries.clear();
  stats_events_ = 0;
  if (restart_time) {
    now_ = stats_time_ = 0;
    // Displays clear themselves when time runs back, and do so after they have seen the new time.
    repeat_due_.postpone(Clock::now(), std::chrono::milliseconds(500));
    publishStates();
  }
  noteChange(true);
}

/// Moves on to `target`, handling on the way what happens at times between.
/// @return false: the budget of events was spent first
bool Simulator::advance(std::int64_t target) {
  listen();
  while (now_ < target) {
    if (commands_.runTimed(now_)) {
      finishCommands();
    }
    const std::int64_t next_states = states_.after(now_);
    const std::int64_t next_command = std::max(now_, commands_.nextTime());
    if (!moveTo(std::min({target, next_states, next_command}))) {
      return false;
    }
    if (now_ == next_states) {
      publishStates();
    }
  }
  return true;
}

/// @return false: the budget of events was spent first; see settled()
bool Simulator::moveTo(std::int64_t target) {
  const auto budget = static_cast<std::uint64_t>(parameters_.max_events_per_frame);
  moved_ = true;
  if (world_.advanceTo(core::Time::fromNanoseconds(target), budget)) {
    now_ = target;
    return true;
  }
  // Commands act on whole nanoseconds only: try to end on the next one.
  const std::int64_t next = world_.now().nanoseconds() + 1;
  if (next < target && world_.advanceTo(core::Time::fromNanoseconds(next), budget)) {
    now_ = next;
  }
  return false;
}

/// Whether the world stands at now(); if not, it has gone further but not yet to the next whole
/// nanosecond.
bool Simulator::settled() const { return world_.now() == core::Time::fromNanoseconds(now_); }

void Simulator::serveCommands() {
  if (settled() && commands_.runDue(now_)) {
    finishCommands();
  }
}

/// Starts when the viewer is there.
void Simulator::awaitViewer() {
  if (!viewer_wait_) {
    return;
  }
  moved_ = true;  // so that it gets markers as soon as it listens
  if (viewer_wait_->over(Clock::now())) {
    setPaused(false);
  }
}

/// Tells what commands have changed, and then who gave them.
void Simulator::finishCommands() {
  if (population_) {
    outputs_.publishProperties(world_, stamp());
  }
  if (changed_) {
    reference_energy_ = energy();
    moved_ = true;
  }
  population_ = changed_ = false;
  commands_.answer();
}

/// Sleeps until the next frame, serving commands meanwhile.
void Simulator::waitForNextFrame() {
  if (!paused_ && parameters_.real_time_factor == 0) {
    return;
  }
  next_frame_ += clock_due_.period();
  const Clock::time_point now = Clock::now();
  if (now > next_frame_) {
    late_frames_ += paused_ ? 0 : 1;
    if (now > next_frame_ + clock_due_.period()) {
      next_frame_ = now;  // no burst of frames to make up for lost time
    }
  }
  while (!stop_() && Clock::now() < next_frame_) {
    commands_.waitUntil(next_frame_);
    serveCommands();
  }
}

/// Publishes what is due by the wall clock, and what has happened since the last time.
/// @param frame_ended  whether the frame has run its whole length
void Simulator::publishFrame(bool frame_ended) {
  dropped_collisions_ += outputs_.publishCollisions(collisions_, start_, stamp());
  const Clock::time_point wall = Clock::now();
  const bool on_schedule = frame_ended && (paused_ || parameters_.real_time_factor > 0);
  if (on_schedule) {
    clock_due_.postpone(wall, clock_due_.period());
  }
  if (on_schedule || clock_due_.due(wall)) {
    outputs_.publishClock(stamp());
  }
  if (markers_due_.due(wall)) {
    const bool still_due = still_markers_due_.due(wall);
    if (moved_ || still_due) {
      outputs_.publishMarkers(world_, stamp());
      moved_ = false;
    }
  }
  if (stats_due_.due(wall)) {
    outputs_.publishStats(stats(wall));
    tellNews();
  }
  if (repeat_due_.due(wall)) {
    outputs_.repeatLatched();
  }
}

void Simulator::publishStates() {
  if (parameters_.state_rate > 0) {
    outputs_.publishStates(world_, stamp());
  }
}

/// Has the world report impacts while somebody wants to know them.
void Simulator::listen() {
  if (outputs_.wantsCollisions() != listening_) {
    listening_ = !listening_;
    world_.setCollisionLog(listening_ ? &collisions_ : nullptr);
  }
}

/// Logs a change of method, and once each what the user should know of scene and method.
void Simulator::tellNews() {
  const core::MethodChoice method = world_.method();
  if (method.name != method_) {
    ROS_INFO_STREAM("method " << method.name << " (" << method.reason << ")");
    method_ = method.name;
  }
  warnOnce(core::policyWarning(world_), warned_of_policy_);
  warnOnce(world_.warning(), warned_of_method_);
}

void Simulator::warnOnce(const std::string& warning, bool& warned) {
  if (warned || warning.empty()) {
    return;
  }
  ROS_WARN_STREAM(warning);
  warned = true;
}

SimStats Simulator::stats(Clock::time_point wall) {
  const core::Statistics counts = world_.statistics();
  const double wall_seconds = std::chrono::duration<double>(wall - stats_wall_).count();
  const auto perWallSecond = [&](double amount) {
    return wall_seconds > 0 ? amount / wall_seconds : 0;
  };
  SimStats stats;
  stats.header.stamp = stamp();
  stats.header.frame_id = parameters_.frame_id;
  stats.simulated_time = static_cast<double>(now_) / 1e9;
  stats.paused = paused_;
  stats.balls = static_cast<std::uint32_t>(world_.size());
  stats.method = world_.method().name;
  stats.method_reason = world_.method().reason;
  stats.real_time_factor = perWallSecond(static_cast<double>(now_ - stats_time_) / 1e9);
  stats.real_time_factor_target = parameters_.real_time_factor;
  stats.events_per_second = perWallSecond(static_cast<double>(counts.events - stats_events_));
  stats.ball_collisions = counts.ball_collisions;
  stats.wall_collisions = counts.wall_collisions;
  stats.events = counts.events;
  stats.queue_depth = counts.queue_depth;
  stats.kinetic_energy = world_.kineticEnergy();
  stats.potential_energy = world_.potentialEnergy();
  stats.momentum = toVector(world_.momentum());
  stats.energy_drift = stats.kinetic_energy + stats.potential_energy - reference_energy_;
  stats.deepest_overlap = counts.deepest_overlap;
  stats.ambiguous_impacts = counts.ambiguous_impacts;
  stats.late_frames = late_frames_;
  stats.dropped_collisions = dropped_collisions_;
  stats_wall_ = wall;
  stats_time_ = now_;
  stats_events_ = counts.events;
  return stats;
}

}  // namespace ball_sim
