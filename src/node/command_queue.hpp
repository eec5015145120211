// The way from the threads that serve ROS to the one thread that owns the world.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>

namespace ball_sim {

/// Work for the world's thread, done in order of arrival or at an exact simulated time.
///
/// Who asks waits for the answer, but never longer than a deadline of wall time: work that has not
/// begun by then is withdrawn, so that "not done" is final.
class CommandQueue {
 public:
  using Clock = std::chrono::steady_clock;
  using Work = std::function<void()>;  ///< must not throw

  enum class Outcome {
    done,
    timed_out,  ///< not begun before the deadline; it never will be
    withdrawn,  ///< taken back by withdrawTimed() or close()
  };

  static constexpr std::int64_t kNow = std::numeric_limits<std::int64_t>::min();
  static constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

  /// Has `work` done on the world's thread, and waits for it. Any thread but that one.
  /// @param at        simulated time, ns; kNow: at the next occasion
  /// @param deadline  work that has begun is waited for beyond it
  Outcome execute(Work work, std::int64_t at, Clock::time_point deadline);

  // --- for the world's thread

  /// Does what waits for `now` or earlier, in order of time, then what waits for no certain time,
  /// in order of arrival. What arrives meanwhile is left for the next call. Who asked goes on
  /// waiting until answer().
  /// @return whether anything was done
  bool runDue(std::int64_t now);

  /// The same, but only what waits for a certain time.
  bool runTimed(std::int64_t now);

  /// Tells who asked for what was done since the last call.
  void answer();

  /// The earliest time that work waits for, ns, or kNever.
  std::int64_t nextTime() const;

  /// Sleeps until `wake`, or until work for kNow has arrived.
  void waitUntil(Clock::time_point wake);

  /// Takes back all that waits for a certain time.
  void withdrawTimed();

  /// Takes back all that waits, and from now on all that comes; answers what was done.
  void close();

 private:
  enum class State { waiting, running, done, withdrawn };
  struct Command {
    Work work;
    State state = State::waiting;
  };
  using CommandPointer = std::shared_ptr<Command>;
  using Lock = std::unique_lock<std::mutex>;

  bool run(const std::deque<CommandPointer>& commands, Lock& lock);
  void finish(std::deque<CommandPointer>& commands, State state);
  std::deque<CommandPointer> takeTimed(std::int64_t now);

  mutable std::mutex mutex_;
  std::condition_variable arrived_;                    // something for kNow
  std::condition_variable finished_;                   // something was done or withdrawn
  std::deque<CommandPointer> queue_;                   // for kNow
  std::multimap<std::int64_t, CommandPointer> timed_;  // by time, then by arrival
  std::deque<CommandPointer> unanswered_;              // done
  bool closed_ = false;
};

}  // namespace ball_sim
