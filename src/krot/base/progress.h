#pragma once

#include <atomic>

namespace krot {

// Set from another thread or a signal handler; solvers look at it between
// steps and return what they have with the termination "interrupted".
using CancelFlag = std::atomic<bool>;

inline bool IsCancelled(const CancelFlag* cancel) {
  return cancel != nullptr && cancel->load(std::memory_order_relaxed);
}

}  // namespace krot
