#pragma once

#include <Eigen/Core>

namespace krot {

// x -> rotation * x + translation; a_from_b takes coordinates in b to those
// in a. The default is the identity.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const {
    return rotation * x + translation;
  }
};

// a_from_c = a_from_b * b_from_c.
inline RigidTransform operator*(const RigidTransform& a_from_b,
                                const RigidTransform& b_from_c) {
  return {a_from_b.rotation * b_from_c.rotation,
          a_from_b * b_from_c.translation};
}

// a_from_b of b_from_a: x -> R' x - R' t.
inline RigidTransform Inverse(const RigidTransform& b_from_a) {
  const Eigen::Matrix3d rotation = b_from_a.rotation.transpose();
  return {rotation, -rotation * b_from_a.translation};
}

// Where a camera of this cam_from_world stands in the world: the point that is
// mapped to the origin, -R' t.
inline Eigen::Vector3d Center(const RigidTransform& cam_from_world) {
  return -cam_from_world.rotation.transpose() * cam_from_world.translation;
}

}  // namespace krot
