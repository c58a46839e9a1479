#include "krot/base/numbers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/testing/thread_ranks.h"

namespace krot::internal {
namespace {

struct Grouped {
  std::vector<double> values;
  std::vector<int32_t> groups;
};

// Of all sizes, with equal ones among them, and what does not count.
Grouped RandomValues(int count, int num_groups) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> exponent(-30, 30);
  std::uniform_int_distribution<int32_t> group(-1, num_groups - 1);
  Grouped grouped;
  for (int n = 0; n < count; ++n) {
    const double value = std::exp(exponent(random));
    grouped.values.push_back(n % 7 == 0    ? 1
                             : n % 11 == 0 ? NAN
                             : n % 13 == 0 ? -value
                             : n % 17 == 0 ? 0
                                           : value);
    grouped.groups.push_back(group(random));
  }
  return grouped;
}

double SortedMedian(const Grouped& grouped, int32_t group) {
  std::vector<double> values;
  for (size_t n = 0; n < grouped.values.size(); ++n) {
    if (grouped.groups[n] == group && grouped.values[n] >= 0) {
      values.push_back(grouped.values[n]);
    }
  }
  std::sort(values.begin(), values.end());
  return values[(values.size() - 1) / 2];
}

TEST(GroupMedians, AreThoseOfTheSortedValues) {
  for (const int count : {60, 1001}) {
    const Grouped grouped = RandomValues(count, 4);
    const std::vector<double> medians =
        GroupMedians(grouped.values, grouped.groups, 4, {});
    for (int32_t group = 0; group < 4; ++group) {
      EXPECT_EQ(medians[group], SortedMedian(grouped, group));
    }
  }
}

TEST(GroupMedians, OfNoValueIsNaN) {
  const std::vector<double> medians = GroupMedians({3, NAN}, {1, 0}, 3, {});
  EXPECT_TRUE(std::isnan(medians[0]));
  EXPECT_EQ(medians[1], 3);
  EXPECT_TRUE(std::isnan(medians[2]));
  EXPECT_TRUE(std::isnan(MedianOf({}, {})));
}

TEST(GroupMedians, AreOfAllRanksToTheBit) {
  const Grouped grouped = RandomValues(500, 3);
  const std::vector<double> whole =
      GroupMedians(grouped.values, grouped.groups, 3, {});
  ThreadRanks::Run(3, [&](Ranks* ranks) {
    Grouped share;
    for (size_t n = ranks->rank(); n < grouped.values.size(); n += 3) {
      share.values.push_back(grouped.values[n]);
      share.groups.push_back(grouped.groups[n]);
    }
    Context context;
    context.ranks = ranks;
    EXPECT_EQ(GroupMedians(share.values, share.groups, 3, context), whole);
  });
}

}  // namespace
}  // namespace krot::internal
