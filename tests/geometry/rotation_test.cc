#include "krot/geometry.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace krot::internal {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Translation3d;
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

Isometry3d Isometry(double angle, const Vector3d& axis, const Vector3d& t) {
  return Translation3d(t) * AngleAxisd(angle, axis.normalized());
}

RigidTransform From(const Isometry3d& isometry) {
  return {isometry.linear(), isometry.translation()};
}

const Isometry3d kRigFromWorld = Isometry(1.2, {1, -2, 3}, {4, -5, 6});
const Isometry3d kCamFromRig = Isometry(-0.4, {0, 1, 7}, {0.1, 0.2, -0.3});
const Vector3d kPoint(7, 8, -9);

TEST(RigidTransform, MovesPointsAsAnIsometry) {
  EXPECT_LT((From(kRigFromWorld) * kPoint - kRigFromWorld * kPoint).norm(),
            1e-14);
  EXPECT_EQ(RigidTransform() * kPoint, kPoint);
}

TEST(RigidTransform, IsComposedAsAnIsometry) {
  const RigidTransform composed = From(kCamFromRig) * From(kRigFromWorld);
  const Isometry3d expected = kCamFromRig * kRigFromWorld;
  EXPECT_LT((composed.rotation - expected.linear()).norm(), 1e-15);
  EXPECT_LT((composed.translation - expected.translation()).norm(), 1e-14);
}

TEST(Inverse, LeadsBack) {
  const RigidTransform inverse = Inverse(From(kRigFromWorld));
  const Isometry3d expected = kRigFromWorld.inverse();
  EXPECT_LT((inverse.rotation - expected.linear()).norm(), 1e-15);
  EXPECT_LT((inverse.translation - expected.translation()).norm(), 1e-14);
}

TEST(Center, IsWhatTheTransformTakesToTheOrigin) {
  const Vector3d center = Center(From(kRigFromWorld));
  EXPECT_LT((kRigFromWorld * center).norm(), 1e-14);
  EXPECT_LT((center - kRigFromWorld.inverse().translation()).norm(), 1e-14);
}

TEST(Similarity, MovesPointsAsAnAffineMap) {
  const Similarity similarity{2.5, kRigFromWorld.linear(),
                              kRigFromWorld.translation()};
  const Eigen::Affine3d expected = kRigFromWorld * Eigen::Scaling(2.5);
  EXPECT_LT((similarity * kPoint - expected * kPoint).norm(), 1e-14);
  EXPECT_EQ(Similarity() * kPoint, kPoint);
}

}  // namespace
}  // namespace krot::internal
