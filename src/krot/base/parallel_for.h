#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

namespace krot::internal {

// Threads that wait for work, because creating them takes time. There are as
// many as calls of Run have needed at the same time.
//
// There is one pool. It is never destroyed and its threads are detached: at the
// end of the process they sleep, and nothing waits for them. A child process
// begins with an empty pool of its own. A process that forks within a call of
// Run may only call exec in the child.
class ThreadPool {
 public:
  static ThreadPool& Get();

  // Calls work(0) on this thread and work(1), ..., work(num_workers - 1) on
  // threads of the pool, in the floating-point environment of this thread.
  // Returns when all calls that began have ended. Calls that have not begun
  // when work(0) returns, or for which the system has no thread, are left out:
  // work(0) alone must be able to finish the work. `work` may call Run, and
  // must not throw.
  void Run(int num_workers, const std::function<void(int worker)>& work);

 private:
  struct Task;

  ThreadPool() = default;
  void AddThreads();
  void Serve();
  void Close(const Task* task);

  std::mutex mutex_;  // guards all that follows
  std::condition_variable is_open_;
  std::vector<Task*>
      open_;  // have calls that have not begun; the last task is served first
  int num_to_begin_ = 0;  // calls of all tasks that have not begun
  int num_idle_ = 0;      // threads without work
};

// The number of threads that `requested` stands for: itself if positive,
// otherwise the number of hardware threads. At least 1.
int ResolveNumThreads(int requested);

// A reference to any callable body(begin, end, worker). A std::function for
// each of them would take more time to compile than most bodies themselves.
class ChunkBody {
 public:
  template <typename Body>
  ChunkBody(const Body& body)  // NOLINT(google-explicit-constructor)
      : body_(&body),
        call_([](const void* called, int64_t begin, int64_t end, int worker) {
          (*static_cast<const Body*>(called))(begin, end, worker);
        }) {}

  void operator()(int64_t begin, int64_t end, int worker) const {
    call_(body_, begin, end, worker);
  }

 private:
  const void* body_;
  void (*call_)(const void*, int64_t, int64_t, int);
};

// Calls body(begin, end, worker) exactly once for each of the fixed chunks [0,
// chunk_size), [chunk_size, 2 chunk_size), ... of [0, count), on up to
// `num_threads` threads of the pool (as ResolveNumThreads says). `worker` in
// [0, num_threads) is the number of the thread; bodies use it to choose scratch
// memory. Calls may be nested.
//
// The chunks depend on `count` and `chunk_size` alone, never on the number of
// threads or the clock. So a body that writes only what belongs to its chunk
// gives the same bits at any number of threads. A reduction should write to one
// slot per chunk and sum these up in order afterwards.
//
// If bodies throw, all chunks are visited nevertheless, and the exception of
// the first chunk that threw is rethrown afterwards.
void ParallelFor(int64_t count, int64_t chunk_size, int num_threads,
                 const ChunkBody& body);

// The chunk size for cheap work.
inline constexpr int64_t kItemsPerChunk = 256;

// Calls body(i) for every i in [0, count); it may write only what belongs to i.
template <typename Body>
void ParallelForEach(int64_t count, int num_threads, const Body& body,
                     int64_t chunk_size = kItemsPerChunk) {
  ParallelFor(count, chunk_size, num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t i = begin; i < end; ++i) body(i);
              });
}

// The number of chunks that ParallelFor makes.
inline int64_t NumChunks(int64_t count, int64_t chunk_size) {
  return (count + chunk_size - 1) / chunk_size;
}

// The largest value(i) of all i in [0, count), but at least 0.
template <typename Value>
double ParallelMax(int64_t count, int num_threads, const Value& value) {
  std::vector<double> largest(NumChunks(count, kItemsPerChunk), 0);
  ParallelFor(count, kItemsPerChunk, num_threads,
              [&](int64_t begin, int64_t end, int) {
                double of_chunk = 0;
                for (int64_t i = begin; i < end; ++i) {
                  of_chunk = std::max(of_chunk, value(i));
                }
                largest[begin / kItemsPerChunk] = of_chunk;
              });
  return largest.empty() ? 0
                         : *std::max_element(largest.begin(), largest.end());
}

}  // namespace krot::internal
