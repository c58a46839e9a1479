#pragma once

#include <Eigen/Core>

namespace krot {

struct Ball {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // m*
  double radius = 0;                                 // f*
};

// The smallest ball that holds `count` points in R^3, 1 <= count <= 4, by the
// paper's enumeration of cases [Zhang18, Sec. 3.1.2]. Closed form; throws
// std::invalid_argument for other counts.
//
// For points of equal norm the centre is also the point of least norm of
// their convex hull, since max_i |g_i - m|^2 = 1 + |m|^2 - 2 min_i g_i.m:
// MinNormPoint serves where there are more than four.
Ball MinEnclosingBall(const Eigen::Vector3d* points, int count);

}  // namespace krot
