#include "krot/base/disjoint_sets.h"

#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

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
