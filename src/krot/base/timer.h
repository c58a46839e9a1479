#pragma once

#include <chrono>

namespace krot::internal {

// Wall-clock seconds since construction. For reports only: no decision of a
// solver depends on it.
class Timer {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

}  // namespace krot::internal
