#include "krot/geometry.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace krot::internal {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

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
