#pragma once

#include <Eigen/Core>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// Poses of the scene, their quaternions of unit norm.

Pose UnitPose(const RigidTransform& transform);

// The pose with this rotation and this centre: x -> R (x - center).
Pose PoseFromCenter(const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& center);

}  // namespace krot::internal
