#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "krot/minimax/norm.h"

namespace krot {

// The symmetric cones of one observation and their Jordan algebras
// [Alizadeh, Goldfarb 2003]: for p = 2 the second-order cone ||v|| <= gamma w
// in R^3; for p = 1 and infinity four half-planes.
//
// Each offers, for vectors of kDim numbers: the identity, the product, the
// solution y of x o y = r (Divide), the smallest eigenvalue, the square of that
// of a pair (SmallestProduct), the vector with its eigenvalues limited to a
// range (Clamp), and the longest step that stays in the cone.

struct SecondOrderCone {
  static constexpr int kDim = 3;
  static constexpr int kDegree =
      1;  // of the barrier: s.z = degree * mu on the central path
  using Vector = Eigen::Matrix<double, kDim, 1>;

  static Vector Identity() { return {1, 0, 0}; }

  static Vector Product(const Vector& x, const Vector& y) {
    Vector result;
    result << x.dot(y), x[0] * y.tail<2>() + y[0] * x.tail<2>();
    return result;
  }

  static double Determinant(const Vector& x) {
    const double norm = x.tail<2>().norm();
    return (x[0] - norm) * (x[0] + norm);
  }

  static Vector Divide(const Vector& x, const Vector& r) {
    const double det = Determinant(x);
    const double xr = x.tail<2>().dot(r.tail<2>());
    Vector result;
    result[0] = (x[0] * r[0] - xr) / det;
    result.tail<2>() = (r.tail<2>() - result[0] * x.tail<2>()) / x[0];
    return result;
  }

  static double SmallestEigenvalue(const Vector& x) {
    return x[0] - x.tail<2>().norm();
  }

  // Of lambda = W z = W^-1 s, W being the scaling of a pair in the cone
  // (nt_scaling.h), the smallest eigenvalue squared: the lesser root of
  // t^2 - 2 s'z t + det(s) det(z).
  static double SmallestProduct(const Vector& s, const Vector& z) {
    const double half_sum = s.dot(z);
    const double product = Determinant(s) * Determinant(z);
    const double root = std::sqrt(std::max(0.0, half_sum * half_sum - product));
    return product / (half_sum + root);
  }

  // With the eigenvectors of x; x itself if its eigenvalues are in the range.
  static Vector Clamp(const Vector& x, double low, double high) {
    const double norm = x.tail<2>().norm();
    if (x[0] - norm >= low && x[0] + norm <= high) return x;
    const double least = std::min(std::max(x[0] - norm, low), high);
    const double largest = std::min(std::max(x[0] + norm, low), high);
    Vector result;
    result[0] = (largest + least) / 2;
    result.tail<2>().setZero();
    if (norm > 0) {
      result.tail<2>() = (largest - least) / (2 * norm) * x.tail<2>();
    }
    return result;
  }

  // The largest alpha <= limit with x + alpha d in the cone; x inside it.
  static double MaxStep(const Vector& x, const Vector& d, double limit) {
    // (x0 + alpha d0)^2 - |x1 + alpha d1|^2 = c + 2 b alpha + a alpha^2 >= 0
    const double a = d[0] * d[0] - d.tail<2>().squaredNorm();
    const double b = x[0] * d[0] - x.tail<2>().dot(d.tail<2>());
    const double c = Determinant(x);
    // b^2 >= a c, with equality towards the apex: there only rounding differs.
    const double root = std::sqrt(std::max(0.0, b * b - a * c));
    // The smallest positive root, without cancellation, is where x leaves.
    const double q = b > 0 ? -b - root : -b + root;
    for (const double alpha : {q / a, c / q}) {
      if (alpha > 0) limit = std::min(limit, alpha);
    }
    return limit;
  }
};

struct FourHalfLines {
  static constexpr int kDim = 4;
  static constexpr int kDegree = 4;
  using Vector = Eigen::Matrix<double, kDim, 1>;

  static Vector Identity() { return Vector::Ones(); }

  static Vector Product(const Vector& x, const Vector& y) {
    return x.cwiseProduct(y);
  }

  static Vector Divide(const Vector& x, const Vector& r) {
    return r.cwiseQuotient(x);
  }

  static double SmallestEigenvalue(const Vector& x) { return x.minCoeff(); }

  static double SmallestProduct(const Vector& s, const Vector& z) {
    return s.cwiseProduct(z).minCoeff();
  }

  static Vector Clamp(const Vector& x, double low, double high) {
    return x.cwiseMax(low).cwiseMin(high);
  }

  static double MaxStep(const Vector& x, const Vector& d, double limit) {
    for (int k = 0; k < kDim; ++k) {
      if (d[k] < 0) limit = std::min(limit, -x[k] / d[k]);
    }
    return limit;
  }
};

// T: (top; v) into the cone of kDim numbers, which it is in if ||v||_p <= top.
template <int kDim>
Eigen::Matrix<double, kDim, 3> ConeMap(Norm norm) {
  Eigen::Matrix<double, kDim, 3> T;
  if constexpr (kDim == 3) {
    T.setIdentity();
  } else if (norm.p == 1) {  // top +- v1 +- v2
    T << 1, 1, 1, 1, 1, -1, 1, -1, 1, 1, -1, -1;
  } else {  // top +- v1, top +- v2
    T << 1, 1, 0, 1, -1, 0, 1, 0, 1, 1, 0, -1;
  }
  return T;
}

// A z of the cone with T'z = (lambda; y), where ||y||_dual <= lambda.
template <int kDim>
Eigen::Matrix<double, kDim, 1> FromMultiplier(Norm norm, double lambda,
                                              const Eigen::Vector2d& y) {
  Eigen::Matrix<double, kDim, 1> z;
  if constexpr (kDim == 3) {
    z << lambda, y;
  } else if (norm.p == 1) {
    if (!(lambda > 0)) return z.setZero();
    const Eigen::Array2d plus = 1 + y.array() / lambda;
    const Eigen::Array2d minus = 1 - y.array() / lambda;
    z << plus[0] * plus[1], plus[0] * minus[1], minus[0] * plus[1],
        minus[0] * minus[1];
    z *= lambda / 4;
  } else {
    z << std::max(y[0], 0.0), std::max(-y[0], 0.0), std::max(y[1], 0.0),
        std::max(-y[1], 0.0);
    z.array() += (lambda - y.lpNorm<1>()) / 4;
  }
  return z;
}

}  // namespace krot
