#include "krot/synthetic/rigid_motion.h"

namespace krot::internal {

Pose UnitPose(const RigidTransform& transform) {
  return {ToWxyz(Eigen::Quaterniond(transform.rotation).normalized()),
          transform.translation};
}

Pose PoseFromCenter(const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& center) {
  return UnitPose({rotation, -(rotation * center)});
}

}  // namespace krot::internal
