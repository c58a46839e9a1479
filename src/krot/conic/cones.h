#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "krot/base/check.h"
#include "krot/geometry.h"

namespace krot::internal {

// Throws std::invalid_argument unless there are cones for the norm.
inline void CheckConic(Norm norm) {
  CheckArgument(norm.p == 2 || norm.IsPolyhedral(), "norm.p", norm.p,
                "1, 2 or infinity");
}

// The symmetric cones of one observation and their Jordan algebras
// [Alizadeh, Goldfarb 2003]: for p = 2 the second-order cone ||v|| <= gamma w
// in R^3; for p = 1 and infinity four half-lines, the positive orthant of R^4.
//
// Each offers, for vectors of kDim numbers: the identity, the product, the
// solution y of x o y = r (Divide), the smallest eigenvalue, the square of the
// smallest eigenvalue of a scaled pair (SmallestProduct), the vector with its
// eigenvalues limited to a range (Clamp), and the longest step that stays in
// the cone.

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

  // The square of the smallest eigenvalue of lambda = W z = W^-1 s, where W is
  // the scaling of the pair s, z (NtScaling): the smaller root of
  // t^2 - 2 s'z t + det(s) det(z).
  static double SmallestProduct(const Vector& s, const Vector& z) {
    const double half_sum = s.dot(z);
    const double product = Determinant(s) * Determinant(z);
    const double root = std::sqrt(std::max(0.0, half_sum * half_sum - product));
    return product / (half_sum + root);
  }

  // Keeps the eigenvectors of x; returns x if its eigenvalues are in the range.
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
    // b^2 >= a c but for rounding, with equality if d points at the apex.
    const double root = std::sqrt(std::max(0.0, b * b - a * c));
    // x leaves the cone at the smallest positive root; this form of the roots
    // avoids cancellation.
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

// T maps (top; v) to kDim numbers that are in the cone exactly if
// ||v||_p <= top.
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

// A vector z of the cone with T'z = (lambda; y); requires ||y||_dual <= lambda.
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

// The product of a cone and a half-line, for observations that may exceed their
// bound by a slack: the last number is the slack's.
template <typename Cone>
struct WithHalfLine {
  static constexpr int kDim = Cone::kDim + 1;
  static constexpr int kDegree = Cone::kDegree + 1;
  using Vector = Eigen::Matrix<double, kDim, 1>;

  static typename Cone::Vector Head(const Vector& x) {
    return x.template head<Cone::kDim>();
  }
  static double Last(const Vector& x) { return x[Cone::kDim]; }
  static Vector Join(const typename Cone::Vector& head, double last) {
    Vector result;
    result << head, last;
    return result;
  }

  static Vector Identity() { return Join(Cone::Identity(), 1); }
  static Vector Product(const Vector& x, const Vector& y) {
    return Join(Cone::Product(Head(x), Head(y)), Last(x) * Last(y));
  }
  static Vector Divide(const Vector& x, const Vector& r) {
    return Join(Cone::Divide(Head(x), Head(r)), Last(r) / Last(x));
  }
  static double SmallestEigenvalue(const Vector& x) {
    return std::min(Cone::SmallestEigenvalue(Head(x)), Last(x));
  }
  static double SmallestProduct(const Vector& s, const Vector& z) {
    return std::min(Cone::SmallestProduct(Head(s), Head(z)), Last(s) * Last(z));
  }
  static Vector Clamp(const Vector& x, double low, double high) {
    return Join(Cone::Clamp(Head(x), low, high),
                std::min(std::max(Last(x), low), high));
  }
  static double MaxStep(const Vector& x, const Vector& d, double limit) {
    limit = Cone::MaxStep(Head(x), Head(d), limit);
    return Last(d) < 0 ? std::min(limit, -Last(x) / Last(d)) : limit;
  }
};

// The Nesterov-Todd scaling of a pair s, z inside a cone: the symmetric
// positive definite W with  W z = W^-1 s = lambda  [Nesterov, Todd 1997;
// Vandenberghe 2010, Sec. 4].
template <typename Cone>
class NtScaling;

// For the second-order cone
//
//   W = eta [ w0  w1' ; w1  I + w1 w1' / (1 + w0) ],  w0^2 - |w1|^2 = 1.
template <>
class NtScaling<SecondOrderCone> {
 public:
  using Vector = SecondOrderCone::Vector;

  NtScaling() = default;
  NtScaling(const Vector& s, const Vector& z) {
    const double root_s = std::sqrt(SecondOrderCone::Determinant(s));
    const double root_z = std::sqrt(SecondOrderCone::Determinant(z));
    const Vector s_unit = s / root_s;
    const Vector z_unit = z / root_z;
    const double cosh = std::sqrt((1 + s_unit.dot(z_unit)) / 2);
    w0_ = (s_unit[0] + z_unit[0]) / (2 * cosh);
    w1_ = (s_unit.tail<2>() - z_unit.tail<2>()) / (2 * cosh);
    eta_ = std::sqrt(root_s / root_z);
  }

  Vector Apply(const Vector& x) const {  // W x
    const double w1x1 = w1_.dot(x.tail<2>());
    Vector result;
    result[0] = eta_ * (w0_ * x[0] + w1x1);
    result.tail<2>() = eta_ * (x.tail<2>() + (x[0] + w1x1 / (1 + w0_)) * w1_);
    return result;
  }

  Vector ApplyInverse(const Vector& x) const {  // W^-1 x
    const double w1x1 = w1_.dot(x.tail<2>());
    Vector result;
    result[0] = (w0_ * x[0] - w1x1) / eta_;
    result.tail<2>() = (x.tail<2>() + (w1x1 / (1 + w0_) - x[0]) * w1_) / eta_;
    return result;
  }

 private:
  double eta_ = 1;
  double w0_ = 1;
  Eigen::Vector2d w1_ = Eigen::Vector2d::Zero();
};

// W = diag(sqrt(s / z)).
template <>
class NtScaling<FourHalfLines> {
 public:
  using Vector = FourHalfLines::Vector;

  NtScaling() = default;
  NtScaling(const Vector& s, const Vector& z)
      : w_(s.cwiseQuotient(z).cwiseSqrt()) {}

  Vector Apply(const Vector& x) const { return w_.cwiseProduct(x); }
  Vector ApplyInverse(const Vector& x) const { return x.cwiseQuotient(w_); }

 private:
  Vector w_ = Vector::Ones();
};

}  // namespace krot::internal
