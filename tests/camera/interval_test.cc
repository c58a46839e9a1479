#include "krot/camera/interval.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

// Long double holds 64 bits: an oracle for what double rounds away.
using Long = long double;

bool Holds(const Interval& interval, Long x) {
  return interval.lo <= x && x <= interval.hi;
}

class IntervalArithmetic : public testing::Test {
 protected:
  double Draw() {
    const double exponent =
        std::uniform_real_distribution<double>(-8, 8)(random_);
    const double sign = random_() % 2 ? 1 : -1;
    return sign * std::pow(10.0, exponent);
  }

  std::mt19937 random_{1};
};

TEST_F(IntervalArithmetic, RoundsOutwards) {
  for (int trial = 0; trial < 20000; ++trial) {
    const double a = Draw();
    const double b = Draw();
    const Interval A = {a, a};
    const Interval B = {b, b};
    EXPECT_TRUE(Holds(A + B, Long{a} + b));
    EXPECT_TRUE(Holds(A - B, Long{a} - b));
    EXPECT_TRUE(Holds(A * B, Long{a} * b));
    EXPECT_TRUE(Holds(A / B, Long{a} / b));
    EXPECT_TRUE(Holds(A + b, Long{a} + b));
    EXPECT_TRUE(Holds(a - B, Long{a} - b));
    EXPECT_TRUE(Holds(A * b, Long{a} * b));
    EXPECT_TRUE(Holds(atan(A), std::atan(Long{a})));
    EXPECT_TRUE(Holds(atan2(A, B), std::atan2(Long{a}, Long{b})) || b < 0);
    const double c = std::abs(a);
    EXPECT_TRUE(Holds(sqrt(Interval{c, c}), std::sqrt(Long{c})));
    const double angle = std::atan(a);
    const Interval Angle = {angle, angle};
    EXPECT_TRUE(Holds(sin(Angle), std::sin(Long{angle})));
    EXPECT_TRUE(Holds(cos(Angle), std::cos(Long{angle})));
    EXPECT_TRUE(Holds(tan(Angle), std::tan(Long{angle})) ||
                std::abs(angle) > 1.57);
  }
}

TEST_F(IntervalArithmetic, HoldsWhatItsOperandsGive) {
  std::uniform_real_distribution<double> unit(0, 1);
  for (int trial = 0; trial < 20000; ++trial) {
    const auto draw = [&] {
      const double a = 4 * unit(random_) - 2;
      return Interval{a, a + unit(random_)};
    };
    const Interval A = draw(), B = draw();
    const Long a = A.lo + unit(random_) * (Long{A.hi} - A.lo);
    const Long b = B.lo + unit(random_) * (Long{B.hi} - B.lo);
    EXPECT_TRUE(Holds(A * B, a * b));
    EXPECT_TRUE(Holds(A - B, a - b));
    EXPECT_TRUE(Holds(A / B, a / b));
    EXPECT_TRUE(Holds(sin(A), std::sin(a)));
    const Interval angle = atan2(A, B);
    EXPECT_TRUE(std::isnan(angle.lo) || Holds(angle, std::atan2(a, b)));
  }
}

TEST_F(IntervalArithmetic, ProvesNothingByNumbersThatAreNone) {
  const Interval nothing = sqrt(Interval{-1, 1});
  EXPECT_TRUE(std::isnan(nothing.lo) && std::isnan(nothing.hi));
  const Interval half = {1, NAN};
  const Interval product = half * Interval{2, 3};
  EXPECT_FALSE(product.lo > 0 || product.hi < 1e300);
  EXPECT_TRUE(std::isnan(atan2(Interval{-1, 1}, Interval{-1, 1}).lo));
}

TEST(EncloseAtanOverRoot, HoldsTheFunctionAndItsSlope) {
  for (double t = 1e-12; t < 1e6; t *= 1.37) {
    const Long z = std::sqrt(Long{t});
    const Long value = std::atan(z) / z;
    EXPECT_TRUE(Holds(EncloseAtanOverRoot(t), value)) << t;
    // S' by its series, or its equation where that is accurate.
    Long slope = 0;
    if (t < 0.01) {
      for (int i = 20; i > 0; --i) {
        slope = slope * -Long{t} - Long{1} * i / (2 * i + 1);
      }
    } else {
      slope = (1 / (1 + Long{t}) - value) / (2 * Long{t});
    }
    const Interval enclosure = EncloseAtanOverRootSlope(t);
    EXPECT_TRUE(Holds(enclosure, slope)) << t;
    EXPECT_LT(enclosure.hi - enclosure.lo, 1e-11) << t;
  }
}

}  // namespace
}  // namespace krot::internal
