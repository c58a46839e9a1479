#pragma once

#include <cstdint>
#include <functional>

namespace krot {

// The number of threads that `requested` stands for: itself if positive,
// otherwise the number of hardware threads. At least 1.
int ResolveNumThreads(int requested);

// Calls body(begin, end, worker) for the fixed chunks [0, chunk_size),
// [chunk_size, 2 chunk_size), ... of [0, count), each exactly once, on up to
// `num_threads` threads (resolved as above); `worker` in [0, num_threads)
// names the thread, for scratch memory. The threads are those of thread_pool.h:
// none is created for one thread, nor a second time. Calls may be nested.
//
// The chunks depend on `count` and `chunk_size` alone, never on the number of
// threads or the clock: a body that writes only what belongs to its chunk
// gives the same bits at any thread count. A reduction goes through one slot
// per chunk, summed in order afterwards.
//
// An exception does not keep the other chunks from being visited; the first
// (by chunk order) is rethrown here afterwards.
void ParallelFor(
    int64_t count, int64_t chunk_size, int num_threads,
    const std::function<void(int64_t begin, int64_t end, int worker)>& body);

// How many chunks ParallelFor makes.
inline int64_t NumChunks(int64_t count, int64_t chunk_size) {
  return (count + chunk_size - 1) / chunk_size;
}

}  // namespace krot
