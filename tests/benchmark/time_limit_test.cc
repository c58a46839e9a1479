#include "tools/benchmark/time_limit.h"

#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "krot/base/context.h"

namespace krot::internal {
namespace {

TEST(TimeLimit, RaisesItsFlagOnceItHasPassed) {
  const Timer timer;
  const TimeLimit limit(0.02);
  while (!IsCancelled(limit.flag()) && timer.Seconds() < 60) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(IsCancelled(limit.flag()));
  EXPECT_GE(timer.Seconds(), 0.02);
}

TEST(TimeLimit, IsForgottenOnceItIsGone) {
  const Timer timer;
  {
    const TimeLimit limit(3600);
    EXPECT_FALSE(IsCancelled(limit.flag()));
  }
  EXPECT_LT(timer.Seconds(), 60);
}

}  // namespace
}  // namespace krot::internal
