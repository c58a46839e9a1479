#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <vector>

namespace krot::internal {

// Threads that wait for work, so that none has to be created for it. Their
// number grows with the number that is asked for at the same time.
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

  std::mutex mutex_;  // of all that follows
  std::condition_variable is_open_;
  std::vector<Task*>
      open_;              // have calls that have not begun; served last first
  int num_to_begin_ = 0;  // calls of all of them that have not begun
  int num_idle_ = 0;      // threads without work
};

// The number of threads that `requested` stands for: itself if positive,
// otherwise the number of hardware threads. At least 1.
int ResolveNumThreads(int requested);

// Any callable as body(begin, end, worker), which it refers to: a std::function
// would be compiled anew for each of them, in more time than most bodies take.
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

// Calls body(begin, end, worker) for the fixed chunks [0, chunk_size),
// [chunk_size, 2 chunk_size), ... of [0, count), each exactly once, on up to
// `num_threads` threads (resolved as above); `worker` in [0, num_threads)
// names the thread, for scratch memory. The threads are those of the pool.
// Calls may be nested.
//
// The chunks depend on `count` and `chunk_size` alone, never on the number of
// threads or the clock: a body that writes only what belongs to its chunk
// gives the same bits at any thread count. A reduction goes through one slot
// per chunk, summed in order afterwards.
//
// If bodies throw, all chunks are visited nevertheless, and the exception of
// the first chunk that threw is rethrown afterwards.
void ParallelFor(int64_t count, int64_t chunk_size, int num_threads,
                 const ChunkBody& body);

// A chunk of cheap work.
inline constexpr int64_t kItemsPerChunk = 256;

// body(i) for every i of [0, count); it writes only what belongs to i.
template <typename Body>
void ParallelForEach(int64_t count, int num_threads, const Body& body) {
  ParallelFor(count, kItemsPerChunk, num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t i = begin; i < end; ++i) body(i);
              });
}

// The number of chunks that ParallelFor makes.
inline int64_t NumChunks(int64_t count, int64_t chunk_size) {
  return (count + chunk_size - 1) / chunk_size;
}

}  // namespace krot::internal
