#pragma once

#include <Eigen/Core>

#include "krot/model/model.h"

namespace krot {

// Poses of the scene, written as COLMAP's quaternion and translation.

// The pose with this rotation and this centre: x -> R (x - center).
Pose PoseFromCenter(const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& center);

// The point that the pose maps to the origin: -R' t.
Eigen::Vector3d Center(const Pose& pose);

// a_from_c = a_from_b after b_from_c.
Pose Compose(const Pose& a_from_b, const Pose& b_from_c);

}  // namespace krot
