#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "krot/base/check.h"

namespace krot {

// The p of ||.||_p; 1 <= p <= infinity.
struct Norm {
  double p = 2;

  static constexpr Norm L1() { return {1}; }
  static constexpr Norm L2() { return {2}; }
  static constexpr Norm LInf() {
    return {std::numeric_limits<double>::infinity()};
  }

  // Whether ||v||_p is a maximum of linear functions of v: p = 1, infinity.
  constexpr bool IsPolyhedral() const {
    return p == 1 || p == std::numeric_limits<double>::infinity();
  }
};

// ||v||_p.
inline double NormOf(const Eigen::Vector2d& v, Norm norm) {
  if (norm.p == 2) return v.norm();
  if (norm.p == 1) return std::abs(v[0]) + std::abs(v[1]);
  const double largest = std::max(std::abs(v[0]), std::abs(v[1]));
  if (norm.IsPolyhedral() || !(largest > 0)) return largest;
  return largest * std::pow(std::pow(std::abs(v[0]) / largest, norm.p) +
                                std::pow(std::abs(v[1]) / largest, norm.p),
                            1 / norm.p);
}

// Throws std::invalid_argument unless the norm's cone is one of the conic
// solvers'.
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

}  // namespace krot
