#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace krot {

// The half-line from a camera's centre through an observation, in the world.
struct Ray {
  Eigen::Vector3d centre;
  Eigen::Vector3d direction;  // of unit length
};

// The point whose squared distances to the rays' lines sum to the least: the
// x of sum_i (I - d_i d_i') (x - C_i) = 0. None if the lines are parallel up
// to rounding. O(rays).
std::optional<Eigen::Vector3d> RetriangulateMidpoint(
    const std::vector<Ray>& rays);

}  // namespace krot
