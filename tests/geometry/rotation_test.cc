#include "krot/geometry.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

const AngleAxisd kTurn(1.2, Vector3d(1, -2, 3).normalized());

TEST(RotationOf, IsThatOfAxisAndAngleWhateverTheNormAndSign) {
  const Vector3d v = std::sin(0.6) * kTurn.axis();
  for (const double scale : {1.0, -1.0, 7.0, 1e-3}) {
    const QuaternionWxyz wxyz = {scale * std::cos(0.6), scale * v.x(),
                                 scale * v.y(), scale * v.z()};
    EXPECT_LT((RotationOf(wxyz) - kTurn.matrix()).norm(), 1e-15);
    EXPECT_NEAR(NormalizedQuaternion(wxyz).norm(), 1, 1e-15);
  }
}

TEST(NormalizedQuaternion, KeepsTheBitsOfOneThatIsNormalised) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 1000; ++n) {
    const QuaternionWxyz once = ToWxyz(NormalizedQuaternion(
        {normal(random), normal(random), normal(random), normal(random)}));
    EXPECT_EQ(ToWxyz(NormalizedQuaternion(once)), once);
  }
}

TEST(ToWxyz, KeepsTheCoefficients) {
  EXPECT_EQ(ToWxyz(Eigen::Quaterniond(1, 2, 3, 4)),
            (QuaternionWxyz{1, 2, 3, 4}));
}

TEST(NearestRotation, OfAScaledRotationIsThatRotation) {
  const auto nearest = NearestRotation(3 * kTurn.matrix());
  ASSERT_TRUE(nearest);
  EXPECT_LT((*nearest - kTurn.matrix()).norm(), 1e-14);
}

TEST(NearestRotation, HasNoRotationNearby) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 20; ++n) {
    const Matrix3d M = Matrix3d::NullaryExpr([&] { return normal(random); });
    const auto nearest = NearestRotation(M);
    ASSERT_TRUE(nearest);
    EXPECT_NEAR(nearest->determinant(), 1, 1e-14);
    EXPECT_LT((nearest->transpose() * *nearest - Matrix3d::Identity()).norm(),
              1e-14);
    for (int k = 0; k < 50; ++k) {
      const Vector3d axis =
          Vector3d::NullaryExpr([&] { return normal(random); }).normalized();
      const Matrix3d other =
          *nearest * AngleAxisd(0.05 * normal(random), axis).matrix();
      EXPECT_LE((*nearest - M).norm(), (other - M).norm() + 1e-12);
    }
  }
}

TEST(NearestRotation, IsNoneWhereThereAreMany) {
  EXPECT_FALSE(NearestRotation(Matrix3d::Zero()));
  EXPECT_FALSE(NearestRotation(Vector3d(1, 0, 0).asDiagonal()));
  EXPECT_FALSE(NearestRotation(-Matrix3d::Identity()));
}

TEST(RotationOf, WhatCannotBeNormalisedIsNotANumber) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const QuaternionWxyz& none :
       {QuaternionWxyz{0, 0, 0, 0}, QuaternionWxyz{1e-200, 0, 0, 0},
        QuaternionWxyz{0, 1e200, 0, 0}, QuaternionWxyz{1, 0, kInfinity, 0},
        QuaternionWxyz{1, 0, 0, std::nan("")}}) {
    EXPECT_FALSE(HasRotation(none));
    EXPECT_TRUE(RotationOf(none).array().isNaN().all());
  }
  EXPECT_TRUE(HasRotation({0, 0, -3, 0}));
}

}  // namespace
}  // namespace krot::internal
