#include "krot/camera/undistort.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "krot/camera/models.h"

namespace krot::internal {
namespace {

template <typename Distortion>
class RegularSegment : public testing::Test {
 protected:
  // Coefficients up to `size`, most of them small.
  std::vector<double> DrawCoefficients(double size) {
    std::vector<double> k(Distortion::kNumParams);
    for (double& coefficient : k) coefficient = size * std::pow(Draw(-1, 1), 3);
    return k;
  }

  double Draw(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  Eigen::Vector2d DrawPoint() { return {Draw(-0.9, 0.9), Draw(-0.9, 0.9)}; }

  static Eigen::Matrix2d Derivative(const std::vector<double>& k,
                                    const Eigen::Vector2d& q) {
    Dual<double> x, y;
    Distortion::Apply(k.data(), Dual<double>{q.x(), 1, 0},
                      Dual<double>{q.y(), 0, 1}, &x, &y);
    Eigen::Matrix2d derivative;
    derivative << x.du, x.dv, y.du, y.dv;
    return derivative;
  }

  // The smallest det D' on a grid of the segment from 0 to q.
  static double SmallestDeterminant(const std::vector<double>& k,
                                    const Eigen::Vector2d& q) {
    double smallest = 1;
    for (int i = 1; i <= 2000; ++i) {
      const double t = i / 2000.0;
      smallest = std::min(smallest, Derivative(k, t * q).determinant());
    }
    return smallest;
  }

 private:
  std::mt19937 random_{5};
};

using Distortions =
    testing::Types<RadialDistortion<1>, RadialDistortion<2>,
                   RadialDistortion<4>, BrownDistortion, RationalDistortion,
                   ThinPrismDistortion, RadTanThinPrismDistortion>;
TYPED_TEST_SUITE(RegularSegment, Distortions);

TYPED_TEST(RegularSegment, DeviationBoundHoldsOnTheWholeDisc) {
  for (int trial = 0; trial < 2000; ++trial) {
    const std::vector<double> k = this->DrawCoefficients(0.5);
    const Eigen::Vector2d q = this->DrawPoint();
    const Eigen::Matrix2d deviation =
        this->Derivative(k, q) - Eigen::Matrix2d::Identity();
    const double norm =  // the larger singular value
        (std::hypot(deviation(0, 0) + deviation(1, 1),
                    deviation(1, 0) - deviation(0, 1)) +
         std::hypot(deviation(0, 0) - deviation(1, 1),
                    deviation(1, 0) + deviation(0, 1))) /
        2;
    for (const double share : {1.0, 1.3}) {
      const double bound =
          TypeParam::DeviationBound(k.data(), share * q.norm());
      EXPECT_LE(norm, bound * (1 + 1e-12) + 1e-14);
    }
  }
}

TYPED_TEST(RegularSegment, IsAcceptedOnlyWhereTheDeterminantIsPositive) {
  int num_regular = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const std::vector<double> k = this->DrawCoefficients(1);
    const Eigen::Vector2d q = this->DrawPoint();
    if (!IsRegularSegment<TypeParam>(k.data(), q)) continue;
    ++num_regular;
    EXPECT_GT(this->SmallestDeterminant(k, q), 0);
  }
  EXPECT_GT(num_regular, 200);
}

TYPED_TEST(RegularSegment, IsRefusedOnlyWhereTheDeterminantNearlyVanishes) {
  // Unless the terms of D' are huge and may hide it.
  constexpr double kLargestTerms = 1e3;
  int num_folded = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const std::vector<double> k = this->DrawCoefficients(1);
    const Eigen::Vector2d q = this->DrawPoint();
    const double terms = TypeParam::DeviationBound(k.data(), q.norm());
    if (terms > kLargestTerms) continue;
    if (IsRegularSegment<TypeParam>(k.data(), q)) continue;
    ++num_folded;
    EXPECT_LT(this->SmallestDeterminant(k, q), 1e-3);
  }
  EXPECT_GT(num_folded, 100);
}

TYPED_TEST(RegularSegment, EnclosesTheDeterminantOnEachPart) {
  for (int trial = 0; trial < 500; ++trial) {
    const std::vector<double> k = this->DrawCoefficients(1);
    const Eigen::Vector2d q = this->DrawPoint();
    const double begin = this->Draw(0, 0.9);
    const double end = begin + 0.1;
    const Interval enclosure =
        EncloseDeterminant<TypeParam>(k.data(), q, begin, end);
    for (const double t : {begin, begin + 0.03, begin + 0.07, end}) {
      const double det = this->Derivative(k, t * q).determinant();
      const double rounding = 1e-12 * (1 + std::abs(det));
      EXPECT_FALSE(enclosure.lo > det + rounding);  // NaN claims nothing
      EXPECT_FALSE(enclosure.hi < det - rounding);
    }
  }
}

TEST(RegularSegmentOfSimpleRadial, EndsAtTheFold) {
  const double k[] = {-0.3};
  const double fold = std::sqrt(1 / 0.9);  // (r + k r^3)' = 1 - 0.9 r^2
  using Distortion = RadialDistortion<1>;
  EXPECT_TRUE(IsRegularSegment<Distortion>(k, {fold * (1 - 1e-3), 0}));
  EXPECT_FALSE(IsRegularSegment<Distortion>(k, {fold * (1 + 1e-9), 0}));
}

TEST(RegularSegmentOfSimpleRadial, NeverHoldsNumbersThatAreNotFinite) {
  using Distortion = RadialDistortion<1>;
  const double k[] = {-0.3};
  const double none[] = {0};
  const double bad[] = {NAN};
  EXPECT_FALSE(IsRegularSegment<Distortion>(k, {NAN, 0}));
  EXPECT_FALSE(IsRegularSegment<Distortion>(k, {HUGE_VAL, 0}));
  EXPECT_FALSE(IsRegularSegment<Distortion>(none, {HUGE_VAL, 0}));
  EXPECT_FALSE(IsRegularSegment<Distortion>(bad, {0.1, 0}));
}

TEST(RegularSegmentOfRationalDistortion, IsAcceptedWhereLargeTermsCancel) {
  // As calibrations of ordinary lenses come out; the scale falls from 1 to
  // 0.86.
  const double k[] = {8.1, 3.1, 1e-3, 1e-3, 0.22, 8.2, 4.3, 0.71};
  EXPECT_TRUE(IsRegularSegment<RationalDistortion>(k, {0.9, 0.6}));
}

TEST(RegularSegmentOfRationalDistortion, EndsAtAPole) {
  // 1 - 4 s = 0 at r = 1/2; det D' > 0 on both sides of the pole.
  const double k[] = {0, 0, 0, 0, 0, -4, 0, 0};
  EXPECT_TRUE(IsRegularSegment<RationalDistortion>(k, {0.49, 0}));
  EXPECT_FALSE(IsRegularSegment<RationalDistortion>(k, {0.51, 0}));
}

}  // namespace
}  // namespace krot::internal
