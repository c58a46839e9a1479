#include "krot/base/parallel_for.h"

#include <algorithm>
#include <atomic>
#include <cfenv>
#include <exception>
#include <thread>

#include "krot/base/check.h"
#include "krot/base/system.h"

namespace krot::internal {
// One call of Run. It lives on the caller's stack until no call of its work is
// running or may begin.
struct ThreadPool::Task {
  const std::function<void(int)>& work;
  std::fenv_t environment;
  int num_begun = 1;    // calls that have begun, with the caller's own
  int num_workers;      // largest number of calls
  int num_running = 0;  // calls on threads of the pool
  std::condition_variable is_done;
};

ThreadPool& ThreadPool::Get() {
  static ThreadPool* pool = nullptr;
  // After a fork the child has none of the threads, and the locks are in
  // whatever state they were at the fork: it gets a new pool.
  const auto make_pool = [] { pool = new ThreadPool; };
  [[maybe_unused]] static const bool made = [&] {
    make_pool();
    OnFork(make_pool);
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

// Creates threads until there is one for each call that has not begun.
void ThreadPool::AddThreads() {
  for (; num_idle_ < num_to_begin_; ++num_idle_) {
    try {
      std::thread([this] { Serve(); }).detach();
    } catch (const std::exception&) {
      return;  // the system has no more threads; the existing ones do the work
    }
  }
}

// What a thread of the pool does, for ever.
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

// No further call of `task` will begin.
void ThreadPool::Close(const Task* task) {
  const auto found = std::find(open_.begin(), open_.end(), task);
  if (found == open_.end()) return;
  open_.erase(found);
  num_to_begin_ -= task->num_workers - task->num_begun;
}

int ResolveNumThreads(int requested) {
  if (requested > 0) return requested;
  // Cached, because asking the system opens a file, which takes longer than a
  // small loop.
  static const int num_hardware_threads =
      std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return num_hardware_threads;
}

void ParallelFor(int64_t count, int64_t chunk_size, int num_threads,
                 const ChunkBody& body) {
  CheckAtLeast(1, chunk_size, "chunk_size");
  if (count <= 0) return;
  const int64_t num_chunks = NumChunks(count, chunk_size);
  const int num_workers = static_cast<int>(
      std::min<int64_t>(ResolveNumThreads(num_threads), num_chunks));

  // Threads take chunks as they come; the result must not depend on which takes
  // which.
  std::atomic<int64_t> next_chunk{0};
  std::mutex mutex;
  int64_t failed_chunk = num_chunks;
  std::exception_ptr failure;
  const auto work = [&](int worker) {
    for (;;) {
      const int64_t chunk = next_chunk.fetch_add(1);
      if (chunk >= num_chunks) return;
      try {
        const int64_t begin = chunk * chunk_size;
        body(begin, std::min(begin + chunk_size, count), worker);
      } catch (...) {
        std::lock_guard<std::mutex> lock(mutex);
        if (chunk < failed_chunk) {
          failed_chunk = chunk;
          failure = std::current_exception();
        }
      }
    }
  };

  ThreadPool::Get().Run(num_workers, work);
  if (failure) std::rethrow_exception(failure);
}

}  // namespace krot::internal
