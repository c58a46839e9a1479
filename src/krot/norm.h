#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

namespace krot {

// The p of ||.||_p, the length of a reprojection error (dx, dy) in pixels;
// 1 <= p <= infinity. Bounds are proved for p = 1, 2 and infinity.
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

}  // namespace krot
