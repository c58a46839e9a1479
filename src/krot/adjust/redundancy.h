#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/context.h"
#include "krot/model.h"

namespace krot::internal {

// What shows of every observation's noise in a bundle adjustment: with J the
// derivatives of all errors by all that moves, points, poses and intrinsics,
// the errors at the least squares are R (noise), R = I - J (J'J)^+ J'.
//
// R_ii, 2x2, by track element, at the model as it stands; NaN for those that
// take no part. The points are eliminated, and of the inverse S^-1 of the
// reduced camera system, which is taken densely,
//
//   R_ii = I - A_i H^-1 A_i' - C_i S^-1 C_i',  C_i = F_i - A_i H^-1 (A'F),
//
// with A by the point, H = A'A, and F by everything else. The gauge is free:
// the diagonal of S is raised by 1e-10 of itself, which changes R by as much.
//
// Throws as AdjustBundle. O(n^3) for n unknowns besides the points, 8 n^2
// bytes.
std::vector<Eigen::Matrix2d> ExactRedundancy(
    const Model& model, const BundleAdjustmentOptions& options,
    const Context& context);

}  // namespace krot::internal
