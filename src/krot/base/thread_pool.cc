#include "krot/base/thread_pool.h"

#include <algorithm>
#include <cfenv>
#include <exception>
#include <thread>

#include <pthread.h>

namespace krot {

// One call of Run. It lives on the caller's stack, for as long as it is open or
// a thread is at it.
struct ThreadPool::Task {
  const std::function<void(int)>& work;
  std::fenv_t environment;
  int num_begun = 1;    // the caller's own
  int num_workers;      // at most
  int num_running = 0;  // in the pool
  std::condition_variable is_done;
};

ThreadPool& ThreadPool::Get() {
  static ThreadPool* pool = nullptr;
  // A child has none of the threads, and locks are as they were at the fork.
  const auto make_pool = [] { pool = new ThreadPool; };
  [[maybe_unused]] static const bool made = [&] {
    make_pool();
    pthread_atfork(nullptr, nullptr, make_pool);
    return true;
  }();
  return *pool;
}

void ThreadPool::Run(int num_workers, const std::function<void(int)>& work) {
  if (num_workers <= 1) return work(0);
  Task task{work, {}, 1, num_workers, 0, {}};
  std::fegetenv(&task.environment);
  {
    std::lock_guard<std::mutex> lock(mutex_);
    open_.push_back(&task);
    num_to_begin_ += num_workers - 1;
    AddThreads();
  }
  for (int worker = 1; worker < num_workers; ++worker) is_open_.notify_one();
  work(0);
  std::unique_lock<std::mutex> lock(mutex_);
  Close(&task);
  task.is_done.wait(lock, [&] { return task.num_running == 0; });
}

// As many as there are calls to begin.
void ThreadPool::AddThreads() {
  for (; num_idle_ < num_to_begin_; ++num_idle_) {
    try {
      std::thread([this] { Serve(); }).detach();
    } catch (const std::exception&) {
      return;  // the system has no more threads; those there are do the work
    }
  }
}

// What a thread of the pool does for ever.
void ThreadPool::Serve() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    is_open_.wait(lock, [&] { return !open_.empty(); });
    Task& task = *open_.back();
    const int worker = task.num_begun++;
    --num_to_begin_;
    if (task.num_begun == task.num_workers) Close(&task);
    --num_idle_;
    ++task.num_running;
    lock.unlock();
    std::fesetenv(&task.environment);
    task.work(worker);
    lock.lock();
    ++num_idle_;
    if (--task.num_running == 0) task.is_done.notify_one();
  }
}

// No further call of `task` begins.
void ThreadPool::Close(const Task* task) {
  const auto found = std::find(open_.begin(), open_.end(), task);
  if (found == open_.end()) return;
  open_.erase(found);
  num_to_begin_ -= task->num_workers - task->num_begun;
}

}  // namespace krot
