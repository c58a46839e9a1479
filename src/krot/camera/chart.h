#pragma once

#include <optional>

#include <Eigen/Core>

namespace krot::internal {

// A plane n'X = 1 on which the rays of a camera near one of them have two
// coordinates: X(p) = n + B p, with B'B = I, B'n = 0, |n| = 1.
struct Chart {
  Eigen::Vector3d n;
  Eigen::Matrix<double, 3, 2> B;
};

// The chart in which an observation whose point lies in direction x_cam is
// linearised, a function of the model and of that direction alone:
//
//   perspective lens             z = 1, B = (e1, e2): the lens deforms that
//   (ids 0 to 4, 6)              plane, and where it does not the projection is
//                                linear there;
//   division model (12, 13)      the same up to 80 degrees off the axis;
//   every other, and beyond      the plane tangent to the unit sphere at
//                                x_cam / |x_cam|.
//
// A fisheye is far straighter in the tangent plane than on z = 1: 60 degrees
// off the axis, an equidistant lens has on z = 1 the radial curvature
// 2 tan(60) / f px^-1, in the tangent plane none.
//
// nullopt where the point does not project: x_cam zero or not finite, behind a
// perspective camera, out of the sight of its lens (lens.h).
std::optional<Chart> ChartAt(int model_id, const double* params,
                             const Eigen::Vector3d& x_cam);

// d pixel / d p at the ray of x_cam, 2x2.
Eigen::Matrix2d ChartJacobian(int model_id, const double* params,
                              const Chart& chart, const Eigen::Vector3d& x_cam);

}  // namespace krot::internal
