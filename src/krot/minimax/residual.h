#pragma once

#include <Eigen/Core>

#include "krot/math/norm.h"
#include "krot/minimax.h"

namespace krot::internal {

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

}  // namespace krot::internal
