#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/model/image_geometry.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Points in front of the cameras that see them, or brought there.

// Whether the depth of a point is positive, rounding considered.
bool IsInFront(const ImageGeometry& image, const Eigen::Vector3d& xyz);

struct RepairedPoint {
  Eigen::Vector3d xyz;
  bool is_retriangulated = false;
};

// Leaves the point where it is if it is in front of all its cameras, or if
// re-triangulation from all its rays does not lower the number of cameras
// that it is behind. Requires that the observations have poses and that their
// `view` is the image's index in `images`. O(count); allocates only if a
// camera is behind.
RepairedPoint RepairPoint(const std::vector<ImageGeometry>& images,
                          const Observation* observations, int count,
                          const Eigen::Vector3d& xyz);

}  // namespace krot
