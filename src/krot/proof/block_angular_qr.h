#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/QR>

namespace krot {

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

}  // namespace krot
