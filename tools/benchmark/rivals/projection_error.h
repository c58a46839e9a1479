#pragma once

#include <vector>

#include <ceres/ceres.h>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// A Ceres problem of the residual vectors r_i = v_i / w_i in pixels, or of
// r_i - targets[i], over all translations and points, the first translation
// held. Its parameters are `estimate`'s own numbers; what the pointers lead to
// must outlive it.
void BuildLeastSquares(const KnownRotationProblem& problem,
                       const std::vector<Eigen::Vector2d>* targets,
                       Estimate* estimate, ceres::Problem* least_squares);

// Eliminates the points first, and the frames by dense or sparse factorisation,
// as COLMAP's own bundle adjustment chooses.
ceres::Solver::Options LeastSquaresOptions(const KnownRotationProblem& problem,
                                           int num_threads, Estimate* estimate);

}  // namespace krot::internal
