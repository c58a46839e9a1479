#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "krot/base/context.h"

namespace krot::internal {

// Sets a flag once `seconds` have passed, for solvers that check it between
// their steps.
class TimeLimit {
 public:
  explicit TimeLimit(double seconds);
  TimeLimit(const TimeLimit&) = delete;
  TimeLimit& operator=(const TimeLimit&) = delete;
  ~TimeLimit();

  const CancelFlag* flag() const { return &has_passed_; }

 private:
  CancelFlag has_passed_{false};
  std::mutex mutex_;
  std::condition_variable condition_;
  bool is_over_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace krot::internal
