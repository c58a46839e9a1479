#include "krot/finish/bounded_system.h"

#include <cmath>

#include <gtest/gtest.h>

namespace krot {
namespace {

TEST(LogProduct, IsTheSumOfLogarithmsFarBelowTheSmallestNumber) {
  LogProduct first, second;
  double sum = 0;
  for (int n = 1; n <= 3000; ++n) {
    const double factor = n % 100 == 0 ? 1e-60 : 1 / (1.0 + n % 7);
    LogProduct& product = n % 3 == 0 ? first : second;
    product = product.Times(LogProduct(factor));
    sum += std::log(factor);
  }
  EXPECT_NEAR(first.Times(second).Log(), sum, 1e-12 * std::abs(sum));
}

TEST(LogProduct, OfNothingIsZero) { EXPECT_EQ(LogProduct().Log(), 0); }

}  // namespace
}  // namespace krot
