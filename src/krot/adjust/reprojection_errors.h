#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"

namespace krot::internal {

// The error and the depth of an observation.
struct ProjectedError {
  Eigen::Vector2d r;  // projected minus measured, pixels
  double w;           // depth, > 0
};

// Those of all observations. None if a point is not in front of its camera, or
// an error not below `max_error`. O(observations).
std::optional<std::vector<ProjectedError>> ProjectErrors(
    const AdjustmentBlocks& blocks, double max_error, int num_threads);

// Half the sum of the squared errors.
double HalfSquaredNorm(const std::vector<ProjectedError>& errors);

// The norm of the largest error; 0 if there are no errors.
double LargestError(const std::vector<ProjectedError>& errors);

// No camera model has more parameters.
constexpr int kMaxCameraParams = 16;

// The pixel of a ray (u, v, 1) and its derivatives by (u, v).
struct DifferentiatedPixel {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d J_ray;
};

// Differentiates forwards through lens and distortion, and in closed form by
// focal lengths and principal point, in which the pixel is affine. If
// `J_params` is not null it gets the derivatives by the camera's parameters, 2
// x num_params, row by row. Throws as ProjectRay does; not finite where that is
// not.
DifferentiatedPixel DifferentiatePixel(int model_id, const double* params,
                                       const Eigen::Vector2d& ray,
                                       double* J_params);

// The derivatives D of (error x, error y, depth) of every observation, 3x3 by
// its point and by each block of columns that it depends on:
//
//   x_cam = R_s d_s,  d_s = x_rig - c_s,  x_rig = R_f d_f,  d_f = x - c_f
//
// with R exp([theta]x) in place of R (AdjustmentColumns::Pose).
class ErrorJacobians {
 public:
  // Keeps a reference to `columns`. Reads only the observations of the blocks.
  ErrorJacobians(const AdjustmentColumns& columns,
                 const AdjustmentBlocks& blocks);

  // Evaluates at blocks with the same observations, whose points are in front
  // of their cameras.
  void Evaluate(const AdjustmentBlocks& blocks, int num_threads);

  const Eigen::Matrix3d& by_point(int64_t i) const { return D_[begin_[i]]; }
  // By the block blocks(i)[n]. For the cap, which is the last, it is 0.
  const Eigen::Matrix3d& by_block(int64_t i, int n) const {
    return D_[begin_[i] + 1 + n];
  }
  // Ascending.
  const int32_t* blocks(int64_t i) const {
    return blocks_.data() + begin_[i] + 1;
  }
  int num_blocks(int64_t i) const {
    return static_cast<int>(begin_[i + 1] - begin_[i] - 1);
  }

 private:
  const AdjustmentColumns& columns_;
  std::vector<int64_t> begin_;   // num_observations + 1
  std::vector<int32_t> blocks_;  // kHeld for a point
  std::vector<Eigen::Matrix3d> D_;
};

}  // namespace krot::internal
