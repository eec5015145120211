#include "continuous/worker_pool.hpp"

#include <chrono>
#include <utility>

namespace ball_sim::core {
namespace {

void pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#else
  std::this_thread::yield();
#endif
}

// To be woken takes as long as many a piece of work: so one looks out for a while before one
// sleeps.
template <class Condition>
void lookOutFor(const Condition& condition) {
  constexpr std::chrono::microseconds kPatience(50);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition() && std::chrono::steady_clock::now() < end) pause();
}

}  // namespace

WorkerPool::WorkerPool(unsigned workers) {
  try {
    for (unsigned worker = 1; worker < workers; ++worker) {
      threads_.emplace_back([this, worker] { work(worker); });
    }
  } catch (...) {
    quit();
    throw;
  }
}

WorkerPool::~WorkerPool() { quit(); }

void WorkerPool::quit() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    quits_ = true;
  }
  begin_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerPool::start(const void* task, Call call) {
  if (threads_.empty()) {
    call(task, 0);
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    task_ = task;
    call_ = call;
    busy_ = static_cast<unsigned>(threads_.size());
    ++round_;
  }
  begin_.notify_all();
  attempt(task, call, 0);
  lookOutFor([this] { return busy_ == 0; });
  std::unique_lock<std::mutex> lock(mutex_);
  end_.wait(lock, [this] { return busy_ == 0; });
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

void WorkerPool::work(unsigned worker) {
  std::uint64_t done = 0;
  const auto isCalled = [&] { return quits_ || round_ != done; };
  while (true) {
    lookOutFor(isCalled);
    std::unique_lock<std::mutex> lock(mutex_);
    begin_.wait(lock, isCalled);
    if (quits_) return;
    done = round_;
    const void* task = task_;
    const Call call = call_;
    lock.unlock();
    attempt(task, call, worker);
    lock.lock();
    if (--busy_ == 0) end_.notify_one();
  }
}

void WorkerPool::attempt(const void* task, Call call, unsigned worker) {
  try {
    call(task, worker);
  } catch (...) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!error_) error_ = std::current_exception();
  }
}

}  // namespace ball_sim::core
