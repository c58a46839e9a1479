#include "krot/base/parallel_for.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>

#include "krot/base/check.h"
#include "krot/base/thread_pool.h"

namespace krot {

int ResolveNumThreads(int requested) {
  if (requested > 0) return requested;
  // Asking the system opens a file, which takes longer than a small loop.
  static const int num_hardware_threads =
      std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return num_hardware_threads;
}

void ParallelFor(int64_t count, int64_t chunk_size, int num_threads,
                 const std::function<void(int64_t, int64_t, int)>& body) {
  CheckArgument(chunk_size >= 1, "chunk_size", chunk_size, ">= 1");
  if (count <= 0) return;
  const int64_t num_chunks = NumChunks(count, chunk_size);
  const int num_workers = static_cast<int>(
      std::min<int64_t>(ResolveNumThreads(num_threads), num_chunks));

  // Chunks are fixed; which thread takes which is not, and must not matter.
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

}  // namespace krot
