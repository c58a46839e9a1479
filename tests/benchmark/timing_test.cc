#include "tools/benchmark/timing.h"

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

TEST(MedianOf, IsTheMiddleOrTheMeanOfTheTwoThere) {
  EXPECT_EQ(MedianOf({3}), 3);
  EXPECT_EQ(MedianOf({9, 1, 2}), 2);
  EXPECT_EQ(MedianOf({4, 1, 2, 9}), 3);
}

TEST(TimeInterleaved, RunsInTurnAndAsOftenAsAsked) {
  std::string order;
  const std::vector<double> seconds = TimeInterleaved(
      {[&order] { order += 'a'; }, [&order] { order += 'b'; }}, /*repeats=*/3,
      /*min_seconds=*/0);
  EXPECT_EQ(order, "ababab");
  ASSERT_EQ(seconds.size(), 2u);
}

TEST(TimeInterleaved, TellsALongRunFromAShortOne) {
  const auto work = [](int64_t count) {
    return [count] {
      volatile double sum = 0;
      for (int64_t i = 0; i < count; ++i) sum = sum + 1;
    };
  };
  const std::vector<double> seconds = TimeInterleaved(
      {work(1000), work(100000)}, /*repeats=*/5, /*min_seconds=*/1e-3);
  EXPECT_GT(seconds[1], 10 * seconds[0]);
}

}  // namespace
}  // namespace krot::internal
