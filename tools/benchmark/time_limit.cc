#include "tools/benchmark/time_limit.h"

#include <chrono>

namespace krot::internal {

TimeLimit::TimeLimit(double seconds)
    : thread_([this, seconds] {
        std::unique_lock<std::mutex> lock(mutex_);
        const bool is_over =
            condition_.wait_for(lock, std::chrono::duration<double>(seconds),
                                [this] { return is_over_; });
        if (!is_over) has_passed_ = true;
      }) {}

TimeLimit::~TimeLimit() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_over_ = true;
  }
  condition_.notify_one();
  thread_.join();
}

}  // namespace krot::internal
