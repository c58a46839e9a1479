#pragma once

#include <Eigen/Core>

#include "krot/base/check.h"
#include "krot/geometry.h"

namespace krot::internal {

// Throws std::invalid_argument unless the conic solvers can handle the norm.
inline void CheckConic(Norm norm) {
  CheckArgument(norm.p == 2 || norm.IsPolyhedral(), "norm.p", norm.p,
                "1, 2 or infinity");
}

// The norm dual to ||.||_p; p = 1, 2 or infinity.
template <typename Real>
Real DualNorm(const Eigen::Matrix<Real, 2, 1>& y, Norm norm) {
  if (norm.p == 1) return y.cwiseAbs().maxCoeff();
  return norm.p == 2 ? y.norm() : y.cwiseAbs().sum();
}

}  // namespace krot::internal
