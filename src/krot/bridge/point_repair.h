#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "krot/model/image_geometry.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Points that their images see, or brought there.

struct RepairedPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  bool is_retriangulated = false;
};

// Leaves the point where it is if all its images see it, or if re-triangulation
// from all its rays (where v = 0) does not lower the number of those that do
// not; `is_seen` tells for the i-th observation and a position. Requires that
// the observations have poses and that their `view` is the image's index in
// `images`. O(count); allocates only if an image does not see it.
RepairedPoint RepairPoint(
    const std::vector<ImageGeometry>& images, const Observation* observations,
    int count, const Eigen::Vector3d& xyz,
    const std::function<bool(int, const Eigen::Vector3d&)>& is_seen);

}  // namespace krot
