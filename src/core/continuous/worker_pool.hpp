// Threads that are kept, for work that comes in many short pieces.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace ball_sim::core {

/// Runs a task in all workers at once; the caller is worker 0. Nothing is allocated to run a task.
class WorkerPool {
 public:
  /// @param workers  >= 1; 1: everything runs in the caller
  /// @throws std::system_error  no more threads can be had
  explicit WorkerPool(unsigned workers);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  unsigned size() const { return static_cast<unsigned>(threads_.size()) + 1; }

  /// Calls task(worker) once for each of 0..size()-1 and returns when all are done.
  /// @throws what a task threw, the first of several
  template <class Task>
  void run(const Task& task) {
    start(&task,
          [](const void* what, unsigned worker) { (*static_cast<const Task*>(what))(worker); });
  }

 private:
  using Call = void (*)(const void* task, unsigned worker);

  void start(const void* task, Call call);
  void work(unsigned worker);
  void quit();
  void attempt(const void* task, Call call, unsigned worker);

  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable begin_;
  std::condition_variable end_;
  const void* task_ = nullptr;
  Call call_ = nullptr;
  // Changed under the lock, and looked at without it, too.
  std::atomic<std::uint64_t> round_{0};  // counts the tasks; its change wakes the workers
  std::atomic<unsigned> busy_{0};        // workers that have not finished this round
  std::atomic<bool> quits_{false};
  std::exception_ptr error_;
};

/// Threads for work of any size: where it is not worth waking them, the caller does it alone.
struct WorkerPools {
  explicit WorkerPools(unsigned workers) : all(workers), alone(1) {}

  WorkerPool& forWork(std::size_t size, std::size_t worth) { return size < worth ? alone : all; }

  WorkerPool all;
  WorkerPool alone;
};

/// Shares the work on 0..count-1 among workers, in order: f(begin, end, worker).
template <class Function>
void share(WorkerPool& pool, std::size_t count, const Function& f) {
  pool.run([&](unsigned worker) {
    f(count * worker / pool.size(), count * (worker + 1) / pool.size(), worker);
  });
}

}  // namespace ball_sim::core
