#include "krot/synthetic/rigid_motion.h"

namespace krot {
namespace {

Pose MakePose(const Eigen::Matrix3d& rotation,
              const Eigen::Vector3d& translation) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
  Pose pose;
  pose.quaternion_wxyz = {q.w(), q.x(), q.y(), q.z()};
  pose.translation = translation;
  return pose;
}

}  // namespace

Pose PoseFromCenter(const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& center) {
  return MakePose(rotation, -(rotation * center));
}

Eigen::Vector3d Center(const Pose& pose) {
  return -(pose.Rotation().transpose() * pose.translation);
}

Pose Compose(const Pose& a_from_b, const Pose& b_from_c) {
  const Eigen::Matrix3d R_ab = a_from_b.Rotation();
  return MakePose(R_ab * b_from_c.Rotation(),
                  R_ab * b_from_c.translation + a_from_b.translation);
}

}  // namespace krot
