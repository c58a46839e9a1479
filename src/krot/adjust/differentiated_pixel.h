#pragma once

#include <Eigen/Core>

namespace krot {

// No camera model has more parameters.
constexpr int kMaxCameraParams = 16;

// The pixel of a ray (u, v, 1) and its derivatives by (u, v).
struct DifferentiatedPixel {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d J_ray;
};

// By forward differentiation through lens and distortion, behind which the
// pixel is affine in focal lengths and principal point. Writes the derivatives
// by the camera's parameters, too: 2 x num_params, row by row; nowhere if
// `J_params` is null. Throws as ProjectRay does; not finite where that is not.
DifferentiatedPixel DifferentiatePixel(int model_id, const double* params,
                                       const Eigen::Vector2d& ray,
                                       double* J_params);

}  // namespace krot
