#pragma once

#include <cmath>

#include "krot/conic/cones.h"

namespace krot {

// The Nesterov-Todd scaling of a pair s, z inside a cone: the symmetric
// positive definite W with  W z = W^-1 s = lambda  [Nesterov, Todd 1997;
// Vandenberghe 2010, Sec. 4].
template <typename Cone>
class NtScaling;

// W = eta [ w0  w1' ; w1  I + w1 w1' / (1 + w0) ],  w0^2 - |w1|^2 = 1.
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

}  // namespace krot
