#include "command_queue.hpp"

#include <algorithm>
#include <utility>

namespace ball_sim {

CommandQueue::Outcome CommandQueue::execute(Work work, std::int64_t at,
                                            Clock::time_point deadline) {
  const auto command = std::make_shared<Command>();
  command->work = std::move(work);
  Lock lock(mutex_);
  if (closed_) {
    return Outcome::withdrawn;
  }
  if (at == kNow) {
    queue_.push_back(command);
    arrived_.notify_one();
  } else {
    timed_.emplace(at, command);
  }
  const auto settled = [&] {
    return command->state == State::done || command->state == State::withdrawn;
  };
  if (!finished_.wait_until(lock, deadline, settled)) {
    if (command->state == State::waiting) {
      command->state = State::withdrawn;  // whoever takes it out of its queue passes over it
      return Outcome::timed_out;
    }
    finished_.wait(lock, settled);
  }
  return command->state == State::done ? Outcome::done : Outcome::withdrawn;
}

bool CommandQueue::runDue(std::int64_t now) {
  Lock lock(mutex_);
  std::deque<CommandPointer> due = takeTimed(now);
  due.insert(due.end(), queue_.begin(), queue_.end());
  queue_.clear();
  return run(due, lock);
}

bool CommandQueue::runTimed(std::int64_t now) {
  Lock lock(mutex_);
  return run(takeTimed(now), lock);
}

std::int64_t CommandQueue::nextTime() const {
  const Lock lock(mutex_);
  return timed_.empty() ? kNever : timed_.begin()->first;
}

void CommandQueue::waitUntil(Clock::time_point wake) {
  Lock lock(mutex_);
  arrived_.wait_until(lock, wake, [&] { return !queue_.empty(); });
}

void CommandQueue::answer() {
  const Lock lock(mutex_);
  finish(unanswered_, State::done);
}

void CommandQueue::withdrawTimed() {
  const Lock lock(mutex_);
  std::deque<CommandPointer> all = takeTimed(kNever);
  finish(all, State::withdrawn);
}

void CommandQueue::close() {
  answer();
  withdrawTimed();
  const Lock lock(mutex_);
  closed_ = true;
  finish(queue_, State::withdrawn);
}

bool CommandQueue::run(const std::deque<CommandPointer>& commands, Lock& lock) {
  bool any = false;
  for (const CommandPointer& command : commands) {
    if (command->state != State::waiting) {
      continue;
    }
    command->state = State::running;
    lock.unlock();
    command->work();
    lock.lock();
    unanswered_.push_back(command);
    any = true;
  }
  return any;
}

void CommandQueue::finish(std::deque<CommandPointer>& commands, State state) {
  for (const CommandPointer& command : commands) {
    command->state = state;
  }
  commands.clear();
  finished_.notify_all();
}

std::deque<CommandQueue::CommandPointer> CommandQueue::takeTimed(std::int64_t now) {
  std::deque<CommandPointer> due;
  const auto end = timed_.upper_bound(now);
  std::transform(timed_.begin(), end, std::back_inserter(due),
                 [](const auto& entry) { return entry.second; });
  timed_.erase(timed_.begin(), end);
  return due;
}

}  // namespace ball_sim
