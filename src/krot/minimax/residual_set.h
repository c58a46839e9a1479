#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/geometry.h"
#include "krot/minimax.h"
#include "krot/minimax/kernels.h"

namespace krot::internal {

// One of the smooth functions whose maximum is r near x: its value, gradient
// and curvature. For 1 < p < infinity there is one piece, r itself. For p = 1
// and infinity ||v||_p = max s'v over the signs s, and each s gives a piece.
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
// in [-1, 1], and returns how many. Requires positive depth. If r(x) = 0, which
// has no gradient, writes one piece with value, gradient and curvature 0.
int ResidualPieces(const Residual& residual, const Eigen::Vector3d& x,
                   Norm norm, double share, ResidualPiece pieces[kMaxPieces]);

// s'v / w at x, where s is the gradient of ||v||_p at `x_touch`. This function
// is nowhere above r, and equals r at x_touch. Its curvature is left 0.
// Requires 1 < p < infinity and positive depth at x.
ResidualPiece TangentPiece(const Residual& residual, const Eigen::Vector3d& x,
                           const Eigen::Vector3d& x_touch, Norm norm);

// Writes a residual as a row: a_1, b_1, a_2, b_2, c, d.
inline void RowOf(const Residual& residual, double row[kResidualRow]) {
  for (int k = 0; k < 3; ++k) {
    row[k] = residual.A(0, k);
    row[4 + k] = residual.A(1, k);
    row[8 + k] = residual.c[k];
  }
  row[3] = residual.b[0];
  row[7] = residual.b[1];
  row[11] = residual.d;
}

// The residuals of one problem (1), stored in blocks of lanes. Refilling
// allocates only if there are more residuals than ever before.
class ResidualSet {
 public:
  void Clear() { size_ = 0; }
  void Add(const double row[kResidualRow]) {
    const int lane = size_ % kLanes;
    if (lane == 0) AddBlock();
    ResidualBlock& block = blocks_[size_ / kLanes];
    for (int k = 0; k < kResidualRow; ++k) block.row[k][lane] = row[k];
    ++size_;
  }
  void Add(const Residual& residual) {
    double row[kResidualRow];
    RowOf(residual, row);
    Add(row);
  }
  // Adds residual number i of `other`.
  void AddFrom(const ResidualSet& other, int i);

  int size() const { return size_; }
  Residual operator[](int i) const {
    const auto& row = blocks_[i / kLanes].row;
    const int lane = i % kLanes;
    Residual residual;
    for (int k = 0; k < 3; ++k) {
      residual.A(0, k) = row[k][lane];
      residual.A(1, k) = row[4 + k][lane];
      residual.c[k] = row[8 + k][lane];
    }
    residual.b = {row[3][lane], row[7][lane]};
    residual.d = row[11][lane];
    return residual;
  }

  double Depth(int i, const Eigen::Vector3d& x) const {
    const auto& row = blocks_[i / kLanes].row;
    const int lane = i % kLanes;
    return row[8][lane] * x[0] + row[9][lane] * x[1] + row[10][lane] * x[2] +
           row[11][lane];
  }

  // max_i r_i(x), the cost; infinity unless all depths are positive, 0 if
  // empty. values()[i] is r_i(x) afterwards.
  double Evaluate(const Eigen::Vector3d& x, Norm norm);
  const double* values() const { return values_.data(); }

  // In the kernels' layout; unused lanes of the last block hold r = 0 / 1.
  const ResidualBlock* blocks() const { return blocks_.data(); }
  int num_blocks() const { return (size_ + kLanes - 1) / kLanes; }

 private:
  void AddBlock();

  int size_ = 0;
  std::vector<ResidualBlock> blocks_;
  std::vector<double> values_;
};

}  // namespace krot::internal
