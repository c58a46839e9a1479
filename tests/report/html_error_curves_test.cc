#include "krot/report/html_page.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "krot/base/numbers.h"

namespace krot::internal {
namespace {

// As real errors: most are small, a few large.
std::vector<double> SomeErrors(int count) {
  std::mt19937 random(7);
  std::lognormal_distribution<double> distribution(-1, 1.2);
  std::vector<double> errors_px(count);
  for (double& error : errors_px) error = distribution(random);
  return errors_px;
}

int64_t CountIn(const std::vector<double>& errors_px, double low, double high) {
  return std::count_if(errors_px.begin(), errors_px.end(), [&](double error) {
    return error >= low && error < high;
  });
}

TEST(ErrorHistogram, CountsWhatLiesBetweenTheEdgesOfEveryBin) {
  const std::vector<double> errors_px = SomeErrors(5000);
  const ErrorHistogram histogram = ComputeErrorHistogram(errors_px);
  for (size_t bin = 0; bin < histogram.counts.size(); ++bin) {
    const auto edge = [](size_t k) {
      return std::pow(10.0, -3 + static_cast<double>(k) / 10);
    };
    EXPECT_EQ(histogram.counts[bin],
              CountIn(errors_px, bin == 0 ? 0 : edge(bin), edge(bin + 1)));
  }
  EXPECT_GT(histogram.counts.back(), 0);
  EXPECT_EQ(std::accumulate(histogram.counts.begin(), histogram.counts.end(),
                            int64_t{0}),
            5000);
}

TEST(ErrorHistogram, PutsZeroIntoTheFirstBinAndNaNNowhere) {
  EXPECT_EQ(ComputeErrorHistogram({0, kNaN, 1e-300}).counts,
            std::vector<int64_t>{2});
  EXPECT_TRUE(ComputeErrorHistogram({kNaN}).counts.empty());
}

TEST(ErrorTail, GivesTheErrorThatHasTheRank) {
  std::vector<double> errors_px = SomeErrors(3000);
  errors_px.push_back(kNaN);
  const auto tail = ErrorTail(errors_px);
  EXPECT_EQ(tail.front().first, 1);
  EXPECT_EQ(tail.back().first, 3000);
  for (const auto& [rank, error] : tail) {
    EXPECT_EQ(CountIn(errors_px, error, 1e300), rank);  // no two are equal
  }
}

TEST(ErrorTail, SpacesRanksByAtMostFivePercentOrOne) {
  const auto tail = ErrorTail(SomeErrors(20000));
  for (size_t i = 1; i < tail.size(); ++i) {
    const int64_t step = tail[i].first - tail[i - 1].first;
    EXPECT_GE(step, 1);
    EXPECT_LE(step, std::max(1.0, 0.05 * static_cast<double>(tail[i].first)));
  }
  EXPECT_LT(tail.size(), 250u);
}

TEST(ErrorTail, OfNoErrorIsEmptyAndOfOneHoldsIt) {
  EXPECT_TRUE(ErrorTail({kNaN}).empty());
  const auto tail = ErrorTail({2.5});
  ASSERT_EQ(tail.size(), 1u);
  EXPECT_EQ(tail[0], std::make_pair(int64_t{1}, 2.5));
}

}  // namespace
}  // namespace krot::internal
