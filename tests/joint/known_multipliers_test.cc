#include "krot/joint/joint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<Multiplier> WithLambdas(const std::vector<double>& lambdas) {
  std::vector<Multiplier> multipliers;
  for (const double lambda : lambdas) {
    multipliers.push_back({lambda, {lambda / 4, -lambda / 8}});
  }
  return multipliers;
}

std::vector<double> LambdasOf(const KnownMultipliers& known,
                              const std::vector<int64_t>& names) {
  std::vector<double> lambdas;
  for (const auto& [lambda, y] : known.Of(names)) {
    lambdas.push_back(lambda);
    EXPECT_EQ(y, Eigen::Vector2d(lambda / 4, -lambda / 8));
  }
  return lambdas;
}

TEST(KnownMultipliers, AreZeroWhereTheyAreNotKnown) {
  KnownMultipliers known;
  known.Keep({2, 5, 9}, WithLambdas({20, 50, 90}), 1);
  EXPECT_THAT(LambdasOf(known, {2, 5, 9}), ElementsAre(20, 50, 90));
  EXPECT_THAT(LambdasOf(known, {0, 2, 3, 9, 11}), ElementsAre(0, 20, 0, 90, 0));
}

TEST(KnownMultipliers, AreEmptyWhereNoneIsKnown) {
  KnownMultipliers known;
  EXPECT_THAT(known.Of({0, 1}), IsEmpty());
  known.Keep({2, 5}, WithLambdas({20, 50}), 1);
  EXPECT_THAT(known.Of({0, 3, 4, 6}), IsEmpty());
  EXPECT_THAT(known.Of({}), IsEmpty());
}

TEST(KnownMultipliers, AreTheLatestThatWereKept) {
  KnownMultipliers known;
  EXPECT_EQ(known.optimum(), 0);
  known.Keep({2, 5, 9}, WithLambdas({20, 50, 90}), 1);
  known.Keep({1, 5, 6}, WithLambdas({10, 55, 60}), 2);
  EXPECT_EQ(known.optimum(), 2);
  EXPECT_THAT(LambdasOf(known, {1, 2, 5, 6, 9}),
              ElementsAre(10, 20, 55, 60, 90));
}

}  // namespace
}  // namespace krot::internal
