#include "krot/synthetic/scene.h"

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

constexpr int kSamples = 200000;

TEST(Random, GivesTheNumbersFixedByTheStandard) {
  // The 10000th output of a default-seeded mt19937_64 is
  // 9981545732273789042 [rand.predef].
  Random random(std::mt19937_64::default_seed);
  for (int n = 1; n < 10000; ++n) random.Uniform();
  EXPECT_EQ(random.Uniform(),
            static_cast<double>(9981545732273789042u >> 11) * 0x1p-53);
}

TEST(Random, UniformHasMeanOneHalfAndStaysInItsInterval) {
  Random random(1);
  double sum = 0;
  for (int n = 0; n < kSamples; ++n) {
    const double x = random.Uniform();
    ASSERT_GE(x, 0);
    ASSERT_LT(x, 1);
    sum += x;
  }
  const double sigma_of_mean = 1 / std::sqrt(12.0 * kSamples);
  EXPECT_NEAR(sum / kSamples, 0.5, 5 * sigma_of_mean);
}

TEST(Random, UniformIntReachesEveryValueAndNoOther) {
  Random random(2);
  std::vector<int> counts(7, 0);
  for (int n = 0; n < kSamples; ++n) {
    ++counts.at(static_cast<size_t>(random.UniformInt(7)));
  }
  for (const int count : counts) {
    EXPECT_NEAR(count, kSamples / 7.0, 5 * std::sqrt(kSamples / 7.0));
  }
}

TEST(Random, GaussianHasTheMomentsOfTheNormalDistribution) {
  Random random(3);
  double sum = 0, sum2 = 0, sum4 = 0;
  for (int n = 0; n < kSamples; ++n) {
    const double x = random.Gaussian();
    sum += x;
    sum2 += x * x;
    sum4 += x * x * x * x;
  }
  // Five standard deviations of each sample moment (variances 1, 2, 96).
  const double root = std::sqrt(static_cast<double>(kSamples));
  EXPECT_NEAR(sum / kSamples, 0, 5 / root);
  EXPECT_NEAR(sum2 / kSamples, 1, 5 * std::sqrt(2.0) / root);
  EXPECT_NEAR(sum4 / kSamples, 3, 5 * std::sqrt(96.0) / root);
}

}  // namespace
}  // namespace krot::internal
