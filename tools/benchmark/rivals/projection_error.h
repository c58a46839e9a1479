#pragma once

#include <vector>

#include <ceres/ceres.h>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Builds a Ceres problem of the residual vectors r_i = v_i / w_i in pixels, or
// of r_i - targets[i], over all translations and points; the first translation
// is held constant. Its parameter blocks are the numbers in `estimate`. All
// arguments must outlive it.
void BuildLeastSquares(const KnownRotationProblem& problem,
                       const std::vector<Eigen::Vector2d>* targets,
                       Estimate* estimate, ceres::Problem* least_squares);

// Options that eliminate the points first, and then the frames by dense or
// sparse factorisation, as COLMAP's bundle adjustment does.
ceres::Solver::Options LeastSquaresOptions(const KnownRotationProblem& problem,
                                           int num_threads, Estimate* estimate);

}  // namespace krot::internal
