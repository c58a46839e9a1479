#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace krot {

// A quaternion's coefficients in COLMAP's order.
using QuaternionWxyz = std::array<double, 4>;

// Of unit norm, whatever norm the coefficients have; they must not all be zero.
// Normalising what has been normalised changes no bit.
Eigen::Quaterniond NormalizedQuaternion(const QuaternionWxyz& wxyz);

// The coefficients, as they are.
QuaternionWxyz ToWxyz(const Eigen::Quaterniond& q);

// Whether it can be normalised: it is finite and not zero. Images that are not
// registered are written with such as cannot.
bool HasRotation(const QuaternionWxyz& wxyz);

// The rotation of the normalised quaternion; NaN if it has none.
Eigen::Matrix3d RotationOf(const QuaternionWxyz& wxyz);

// The rotation nearest to M in the Frobenius norm: U diag(1, 1, det U V') V'
// for M = U S V'. None if there are several, up to 1e-9 of M's norm.
std::optional<Eigen::Matrix3d> NearestRotation(const Eigen::Matrix3d& M);

}  // namespace krot
