#pragma once

#include <Eigen/Core>

#include "krot/math/norm.h"

namespace krot {

// One residual of problem (1):  r(x) = ||A x + b||_p / (c'x + d)
// [Zhang18, (2), (3)], on the half-space of positive depth c'x + d.
struct Residual {
  Eigen::Matrix<double, 2, 3> A;
  Eigen::Vector2d b;
  Eigen::Vector3d c;
  double d = 0;

  Eigen::Vector2d Numerator(const Eigen::Vector3d& x) const {
    return A * x + b;
  }
  double Depth(const Eigen::Vector3d& x) const { return c.dot(x) + d; }
};

// r(x); infinity unless the depth is positive.
double ResidualValue(const Residual& residual, const Eigen::Vector3d& x,
                     Norm norm);

// A smooth function near x of which r is the maximum: its value, gradient and
// curvature. For 1 < p < infinity there is one piece, r itself; for p = 1 and
// infinity ||v||_p = max s'v over the signs s, and each gives a piece.
struct ResidualPiece {
  double value = 0;                                    // s'v / w
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  // (A's - value c) / w
  // The Hessian of ||A x + b||_p / w with w held fixed is of rank one:
  // curvature * bend * bend', bend = A'v_perp / |v|_2.
  double curvature = 0;
  Eigen::Vector3d bend = Eigen::Vector3d::Zero();
};

inline constexpr int kMaxPieces = 4;

// Writes the pieces of r at x whose value is at least `share` of r(x), share
// in [-1, 1], and returns how many. Requires positive depth. Where r(x) = 0,
// which has no gradient, one piece with gradient and curvature 0.
int ResidualPieces(const Residual& residual, const Eigen::Vector3d& x,
                   Norm norm, double share, ResidualPiece pieces[kMaxPieces]);

// s'v / w at x, s the gradient of ||v||_p at `x_touch`: below r everywhere and
// equal to it there. Its curvature is left 0. Requires 1 < p < infinity and
// positive depth at x.
ResidualPiece TangentPiece(const Residual& residual, const Eigen::Vector3d& x,
                           const Eigen::Vector3d& x_touch, Norm norm);

}  // namespace krot
