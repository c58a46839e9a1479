#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace krot {

// The points x with |UnitFromWorld() (x - centre)| <= 1.
struct Ellipsoid {
  Eigen::Vector3d centre;
  Eigen::Vector3d semi_axes;  // > 0
  Eigen::Quaterniond world_from_axes = Eigen::Quaterniond::Identity();

  Eigen::Matrix3d UnitFromWorld() const {
    return semi_axes.cwiseInverse().asDiagonal() *
           world_from_axes.normalized().toRotationMatrix().transpose();
  }
  bool IsBall() const {
    return semi_axes[0] == semi_axes[1] && semi_axes[1] == semi_axes[2];
  }
};

inline Ellipsoid Ball(const Eigen::Vector3d& centre, double radius) {
  return {centre, Eigen::Vector3d::Constant(radius)};
}

}  // namespace krot
