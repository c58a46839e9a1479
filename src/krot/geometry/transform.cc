#include "krot/geometry.h"

#include <cmath>
#include <limits>

#include <Eigen/SVD>

namespace krot {

using namespace internal;

namespace {

using Eigen::Quaterniond;

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The nearest rotation is unique if the two least singular values, the last
// one signed, do not cancel; relative to the largest.
constexpr double kNotUnique = 1e-9;
// A normalised quaternion's squared norm is 1 up to this: four squares and a
// division, half a unit in the last place each.
constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();

}  // namespace

Quaterniond NormalizedQuaternion(const QuaternionWxyz& wxyz) {
  const Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  return std::abs(q.squaredNorm() - 1) <= kRounding ? q : q.normalized();
}

QuaternionWxyz ToWxyz(const Quaterniond& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

bool HasRotation(const QuaternionWxyz& wxyz) {
  const double squared_norm =
      Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).squaredNorm();
  return squared_norm > 0 && std::isfinite(squared_norm);
}

Matrix3d RotationOf(const QuaternionWxyz& wxyz) {
  if (!HasRotation(wxyz)) {
    return Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return NormalizedQuaternion(wxyz).toRotationMatrix();
}

std::optional<Matrix3d> NearestRotation(const Matrix3d& M) {
  const Eigen::JacobiSVD<Matrix3d> svd(
      M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix3d& U = svd.matrixU();
  const Matrix3d& V = svd.matrixV();
  const double sign = (U * V.transpose()).determinant() < 0 ? -1 : 1;
  const Vector3d& values = svd.singularValues();
  if (!(values[1] + sign * values[2] > kNotUnique * values[0])) {
    return std::nullopt;
  }
  return U * Vector3d(1, 1, sign).asDiagonal() * V.transpose();
}

}  // namespace krot
