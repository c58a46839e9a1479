#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/geometry.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {

struct OracleOptimum {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  double cost = 0;         // max_i r_i(x), evaluated in long double
  double lower_bound = 0;  // no point of the ball costs less
};

// The minimum of max_i r_i over the ball of `radius` about `center`, for any
// problem (1) whose minimiser lies in it: slow, simple and independent of
// the library. Deep-cut ellipsoid method in long double.
//
// With gamma the best cost so far, better points z satisfy
//
//   s_i'(A_i z + b_i) <= gamma (c_i'z + d_i)   for all i and all ||s_i||_q <=
//   1,
//
// q the dual exponent: every one is a half-space, and the deepest of those
// that the centre violates cuts the ellipsoid. The same inequality bounds the
// cost over an ellipsoid from below. Ends when the two agree to
// `gap`, in pixels, or where rounding stops it: look at the bound. Some 300 to
// 2000 passes over the residuals.
OracleOptimum MinimizeByEllipsoids(const std::vector<Residual>& residuals,
                                   Norm norm, const Eigen::Vector3d& center,
                                   double radius, double gap = 1e-11);

}  // namespace krot::internal
