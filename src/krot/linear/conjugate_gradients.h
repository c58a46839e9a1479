#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/linear/block_structure.h"

namespace krot::internal {

// L with L L' = A but for what is dropped: a block column keeps its largest
// blocks, half as many as A has there [Lin and More 1999], wherever they stand;
// as rows differ by decades, A's own places are not those that matter. In
// single precision: a preconditioner. Where such a factor does not exist, one
// of A + shift I does [Manteuffel 1980]; so A's blocks on the diagonal should
// be about the identity.
class IncompleteCholesky {
 public:
  // Of A's blocks, in the order of the pattern. False if no shift helps.
  bool Factorize(const BlockPattern& pattern,
                 const std::vector<Eigen::Matrix3d>& blocks);

  // (L L')^-1 rhs. Reads L twice.
  Eigen::VectorXf Solve(const Eigen::VectorXf& rhs) const;

  // The additions and multiplications that make a factor, at most.
  static double Operations(const BlockPattern& pattern);

 private:
  struct Block {
    int32_t row;
    Eigen::Matrix3f value;
  };

  bool TryShift(const BlockPattern& pattern,
                const std::vector<Eigen::Matrix3d>& blocks, float shift);
  void SubtractColumn(int32_t k);
  void KeepLargest(int64_t count);

  // By columns; on the diagonal, inverses.
  std::vector<int64_t> begin_;
  std::vector<Block> L_;
  float shift_ = 0;  // the last one that helped
  // While it is made, column by column: the column at hand; where a row stands
  // in it (-1: nowhere); per column before it, its first block that is not
  // above; per row, the columns whose first such block stands there.
  std::vector<Block> column_;
  std::vector<int32_t> place_;
  std::vector<int64_t> next_;
  std::vector<std::vector<int32_t>> waiting_;
};

// A x = b for a symmetric positive semidefinite A of 3x3 blocks, by conjugate
// gradients [Hestenes and Stiefel 1952] on
//
//   W A W' y = W b,   x = W'y,   W A_kk W' = I for every block k,
//
// preconditioned by an incomplete factor, in less precision than the residuals
// have, and so flexibly [Notay 2000]. The same bits at any number of threads.
class ConjugateGradients {
 public:
  // `blocks` in the order of the pattern, those of the diagonal whole. False if
  // there is no preconditioner. Keeps a reference to the pattern.
  bool Factorize(const BlockPattern& pattern,
                 std::vector<Eigen::Matrix3d> blocks, int num_threads);

  // Ends when |error|_A, by the preconditioner's estimate, has fallen to
  // `tolerance`, relative; false if it does not. An iteration reads A and the
  // preconditioner once.
  bool Solve(const Eigen::VectorXd& rhs, double tolerance, Eigen::VectorXd* x);

  int num_iterations() const { return num_iterations_; }  // of the last Solve

 private:
  void Whiten();
  Eigen::VectorXd Precondition(const Eigen::VectorXd& residual) const;
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const;

  const BlockPattern* pattern_ = nullptr;
  int num_threads_ = 1;
  std::vector<Eigen::Matrix3d> blocks_;  // of W A W'
  std::vector<Eigen::Matrix3d> W_;       // per block column; lower triangles
  IncompleteCholesky incomplete_;
  int num_iterations_ = 0;
};

}  // namespace krot::internal
