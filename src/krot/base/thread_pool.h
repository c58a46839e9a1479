#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <vector>

namespace krot {

// Threads that wait for work instead of being created for it; their number
// grows with what is asked for at the same time.
//
// There is one pool. It is never destroyed and its threads are detached: at the
// end of the process they sleep, and nothing waits for them. A child that the
// process forks begins with an empty pool of its own, unless it is forked
// within a call of Run, which only exec may follow.
class ThreadPool {
 public:
  static ThreadPool& Get();

  // Calls work(0) here and work(1), ..., work(num_workers - 1) on threads of
  // the pool, at the same time and in the floating-point environment of this
  // one; returns when all calls have. Those not begun by the time that work(0)
  // returns are left out, as are those for which the system has no thread:
  // work(0) alone must be able to finish the work. `work` may call Run, and
  // must not throw.
  void Run(int num_workers, const std::function<void(int worker)>& work);

 private:
  struct Task;

  ThreadPool() = default;
  void AddThreads();
  void Serve();
  void Close(const Task* task);

  std::mutex mutex_;  // of all that follows
  std::condition_variable is_open_;
  std::vector<Task*> open_;  // with calls to begin; the last first
  int num_to_begin_ = 0;     // their calls
  int num_idle_ = 0;         // threads
};

}  // namespace krot
