#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/QR>

#include "krot/linear/schur_complement.h"

namespace krot::internal {

// QR by Householder's reflections of matrices of blocks that share columns,
//
//   A = [ P_0            F_0 ]        P_k, F_k have the same rows; P_k may
//       [      P_1       F_1 ]        have no columns, F_k is mostly zeros
//       [           .     :  ]
//
// each P_k for itself, and then what they leave of the shared columns:
//
//   Q_k' [P_k  F_k] = [ R_k  G_k ]        H_0
//                     [  0   H_k ]        H_1  = Q R
//                                          :
//
// As accurate as of the dense matrix, and with only the shared columns the cost
// grows by the square.
class BlockAngularQr {
 public:
  explicit BlockAngularQr(int64_t num_shared_columns);

  // The next block: P_k, and of F_k the columns (ascending) that are not zero.
  // P_k has as many rows as columns at least.
  void Append(const Eigen::MatrixXd& own, std::vector<int64_t> columns,
              const Eigen::MatrixXd& shared);

  // Once all blocks are there. False unless the columns of A are independent,
  // beyond rounding.
  bool Factorize();

  // The x of least norm with A'x = rhs, which is ordered like the columns of A:
  // the blocks' own, then the shared ones.
  Eigen::VectorXd SolveLeastNorm(const Eigen::VectorXd& rhs) const;

 private:
  using Qr = Eigen::HouseholderQR<Eigen::MatrixXd>;

  struct Block {
    Qr qr;  // of P_k
    std::vector<int64_t> columns;
    Eigen::MatrixXd shared;  // [G_k; H_k] of these
    int64_t num_own() const { return qr.cols(); }
    int64_t num_rest() const { return qr.rows() - qr.cols(); }
  };

  bool is_independent_ = true;
  std::vector<Block> blocks_;
  int64_t num_rest_ = 0;             // rows of H
  Eigen::VectorXd squared_lengths_;  // of the shared columns
  Qr rest_;
};

// Under-determined equations M x = rhs with the structure of the known rotation
// problem: three equations per point that is not fixed, three per frame but
// frame 0, and perhaps one more that concerns everything. An observation has
// three unknowns (those that no equation mentions stay 0), which meet the
// equations of its point and, with the opposite sign, of its frame.
struct LeastNormProblem {
  struct Columns {
    int32_t point = 0;
    int32_t frame = 0;
    // By unknown (row) and equation of the point (column).
    Eigen::Matrix3d rows = Eigen::Matrix3d::Zero();
    Eigen::Vector3d last_row = Eigen::Vector3d::Zero();
  };
  int32_t num_points = 0;
  int32_t num_frames = 0;
  bool has_last_row = false;
  std::vector<Columns> columns;      // in the order of their points
  std::vector<char> point_is_fixed;  // empty: none is

  bool IsFixedPoint(int32_t k) const {
    return !point_is_fixed.empty() && point_is_fixed[k] != 0;
  }
  int64_t num_free_points() const {
    return num_points -
           std::count(point_is_fixed.begin(), point_is_fixed.end(), char{1});
  }
  int64_t num_rows() const {
    return 3 * (num_free_points() + num_frames - 1) + has_last_row;
  }
  // The first equation of each point, without meaning for fixed ones; those of
  // frames 1, 2, ... follow.
  std::vector<int64_t> EquationsOfPoints() const;
};

// Their solutions of least norm, x = M' (M M')^-1 rhs. What is factorised is
// M', an observation's three unknowns per row of blocks:
//
//              points          frames but 0    last
//            0    1    2       1    2    3
//   obs 0  [ P              |                | l ]   of frame 0
//   obs 1  [ P              | -P             | l ]   P: rows, 3 x 3
//   obs 2  [      P         |      -P        | l ]   l: last_row, 3 x 1
//   obs 3  [      P         |           -P   | l ]
//   obs 4  [           P    | -P             | l ]
//
// By Householder's reflections (BlockAngularQr), where that is affordable,
// as their multipliers span many decades; beyond `max_dense_rows` by
// eliminating points, which leaves the normal equations of the frames, and of
// the last column its part outside of the span of all others.
//
// Factorize once and then, if it succeeded, Solve as often as needed.
class LeastNormSolver {
 public:
  // The cost of the dense way grows with the rows and the frames' square.
  explicit LeastNormSolver(int num_threads, int64_t max_dense_rows = 1500)
      : num_threads_(num_threads), max_dense_rows_(max_dense_rows) {}

  // False if the equations may have no solution.
  bool Factorize(LeastNormProblem problem);

  // Three unknowns per observation.
  Eigen::VectorXd Solve(const Eigen::VectorXd& rhs) const;

 private:
  bool FactorizeDense();
  void AppendPoint(size_t begin, size_t end);
  bool FactorizeByPoints();
  Eigen::VectorXd SolveByPoints(const Eigen::VectorXd& rhs) const;

  const int num_threads_;
  const int64_t max_dense_rows_;
  LeastNormProblem problem_;
  // Dense: of the transposed equations.
  std::optional<BlockAngularQr> qr_;
  // By points.
  BlockStructure structure_;
  std::unique_ptr<CentredLeastSquares<3>> by_points_;
  Eigen::VectorXd last_row_;  // without its part in the span of the others
  double last_row_norm2_ = 0;
};

}  // namespace krot::internal
