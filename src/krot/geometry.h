#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace krot {

// Rotations, rigid transforms and similarities. Lengths are in scene units.

// x -> rotation * x + translation; a_from_b takes coordinates in b to those
// in a. The default is the identity.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const {
    return rotation * x + translation;
  }
};

// The composition: a_from_c = a_from_b * b_from_c.
RigidTransform operator*(const RigidTransform& a_from_b,
                         const RigidTransform& b_from_c);

// The inverse, a_from_b: x -> R' x - R' t.
RigidTransform Inverse(const RigidTransform& b_from_a);

// The centre of a camera in the world: the point that is mapped to the origin,
// -R' t.
Eigen::Vector3d Center(const RigidTransform& cam_from_world);

// x -> scale * rotation * x + translation; the default is the identity.
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const;
};

// A quaternion's coefficients in COLMAP's order.
using QuaternionWxyz = std::array<double, 4>;

// The quaternion, normalised; the coefficients must not all be zero.
// Normalising a second time changes no bit.
Eigen::Quaterniond NormalizedQuaternion(const QuaternionWxyz& wxyz);

// The coefficients, not normalised.
QuaternionWxyz ToWxyz(const Eigen::Quaterniond& q);

// Whether the quaternion can be normalised: it is finite and not zero. For
// images that are not registered files may hold one that is neither.
bool HasRotation(const QuaternionWxyz& wxyz);

// The rotation of the normalised quaternion; NaN if it has none.
Eigen::Matrix3d RotationOf(const QuaternionWxyz& wxyz);

// The rotation nearest to M in the Frobenius norm: U diag(1, 1, det U V') V'
// for M = U S V'. None if it is not unique, up to 1e-9 of M's norm.
std::optional<Eigen::Matrix3d> NearestRotation(const Eigen::Matrix3d& M);

// The points x with |UnitFromWorld() (x - centre)| <= 1.
struct Ellipsoid {
  Eigen::Vector3d centre;
  Eigen::Vector3d semi_axes;  // > 0
  Eigen::Quaterniond world_from_axes = Eigen::Quaterniond::Identity();

  Eigen::Matrix3d UnitFromWorld() const;
  bool IsBall() const {
    return semi_axes[0] == semi_axes[1] && semi_axes[1] == semi_axes[2];
  }
};

inline Ellipsoid BallAround(const Eigen::Vector3d& centre, double radius) {
  return {centre, Eigen::Vector3d::Constant(radius)};
}

// ---- Lengths in the image ----

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

// The norm dual to ||.||_p; p = 1, 2 or infinity.
template <typename Real>
Real DualNorm(const Eigen::Matrix<Real, 2, 1>& y, Norm norm) {
  if (norm.p == 1) return y.cwiseAbs().maxCoeff();
  return norm.p == 2 ? y.norm() : y.cwiseAbs().sum();
}

}  // namespace krot
