#include "krot/base/numbers.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "krot/base/check.h"
#include "krot/base/context.h"
#include "tests/testing/thread_ranks.h"

namespace krot::internal {
namespace {

// Of any bits: most are very large or very small.
double AnyNumber(std::mt19937_64* random) {
  const uint64_t bits = (*random)();
  double value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

double OrdinaryNumber(std::mt19937_64* random) {
  const double digits =
      std::round(std::ldexp(static_cast<double>((*random)()), -40));
  const int exponent = static_cast<int>((*random)() % 30) - 15;
  return digits * std::pow(10.0, exponent);
}

std::string Standard(double value) {
  std::string text;
  AppendNumber(value, &text);
  return text;
}

TEST(NumberText, WritesWhatTheStandardLibraryWrites) {
  std::mt19937_64 random(1);
  for (int n = 0; n < 20000; ++n) {
    for (const double value : {AnyNumber(&random), OrdinaryNumber(&random)}) {
      if (std::isnan(value)) continue;
      ASSERT_EQ(ShortestTextByC(value), Standard(value));
    }
  }
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double value :
       {0.0, -0.0, 1.0, 1e22, 1e-5, 123456789012345678.0, 5e-324,
        1.7976931348623157e308, infinity, -infinity}) {
    EXPECT_EQ(ShortestTextByC(value), Standard(value));
  }
}

TEST(NumberText, ReadsWhatTheStandardLibraryReads) {
  std::mt19937_64 random(2);
  for (int n = 0; n < 20000; ++n) {
    const std::string text = Standard(AnyNumber(&random));
    ASSERT_EQ(ParseRealByC(text).has_value(),
              ParseNumber<double>(text).has_value());
    if (text.find("nan") != std::string::npos) continue;
    ASSERT_EQ(ParseRealByC(text), ParseNumber<double>(text));
  }
}

TEST(NumberText, RefusesWhatTheStandardLibraryRefuses) {
  for (const char* text :
       {"",      "-",          "+1",       " 1",    "1 ",     "0x10",   "1e",
        "e5",    ".",          "-.",       "1e400", "-1e400", "1e-400", "0e5",
        "0e400", "0.000e-999", "00",       "1.",    ".5",     "-.5",    "--1",
        "inf",   "-inf",       "infinity", "INF",   "1,5",    "1e5x",   "1f"}) {
    EXPECT_EQ(ParseRealByC(text), ParseNumber<double>(text)) << text;
  }
}

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

TEST(CheckArgument, SaysNameValueAndRequirement) {
  try {
    CheckArgument(false, "options.step", -0.5, "> 0");
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "options.step = -0.5, must be > 0");
  }
}

TEST(CheckArgument, IsSilentWhenAllIsWell) {
  EXPECT_NO_THROW(CheckArgument(true, "step", 1, "> 0"));
}

TEST(CancelFlag, MayBeAbsent) {
  EXPECT_FALSE(IsCancelled(nullptr));
  CancelFlag flag{false};
  EXPECT_FALSE(IsCancelled(&flag));
  flag = true;
  EXPECT_TRUE(IsCancelled(&flag));
}

TEST(DisjointSets, AreOfOneMemberEachAtFirst) {
  DisjointSets sets(3);
  for (int member = 0; member < 3; ++member) {
    EXPECT_EQ(sets.Find(member), member);
  }
}

TEST(DisjointSets, AreNamedAfterTheirSmallestMemberHoweverTheyWereUnited) {
  constexpr int kCount = 60;
  std::mt19937 random(1);
  std::uniform_int_distribution<int> any(0, kCount - 1);
  DisjointSets sets(kCount);
  std::vector<int> smallest(kCount);  // by relabelling everything each time
  for (int n = 0; n < kCount; ++n) smallest[n] = n;
  for (int n = 0; n < 40; ++n) {
    const int a = any(random);
    const int b = any(random);
    sets.Unite(a, b);
    const int low = std::min(smallest[a], smallest[b]);
    const int high = std::max(smallest[a], smallest[b]);
    for (int& name : smallest) {
      if (name == high) name = low;
    }
    for (int member = 0; member < kCount; ++member) {
      ASSERT_EQ(sets.Find(member), smallest[member]);
    }
  }
}

}  // namespace
}  // namespace krot::internal
