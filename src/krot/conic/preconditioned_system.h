#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/conic/block_pattern.h"
#include "krot/conic/dense_cholesky.h"
#include "krot/conic/incomplete_cholesky.h"

namespace krot {

// What an operation of a sparse factor takes, by one of a dense one: 12 to 21
// were measured with 800 to 3000 frames of many patterns, on one thread.
inline constexpr double kSparseOperation = 15;

// What stands for the inverse of a matrix, in the order of exactness.
enum class Preconditioner {
  kIncomplete,  // a factor as sparse as the matrix, in single precision
  kSingle,      // a dense one
  kDouble,      // the same in double precision
};

// A x = b for a symmetric positive semidefinite A of 3x3 blocks, by conjugate
// gradients [Hestenes and Stiefel 1952] on
//
//   W A W' y = W b,   x = W'y,   W A_kk W' = I for every block k,
//
// preconditioned with less precision, and so flexibly [Notay 2000]. It begins
// with the preconditioner that is predicted to take the least time, and takes
// the next one once the iterations that were needed make that the cheaper, or
// do not end: the nearer an interior point is to its end, the farther rows are
// apart.
//
// The same bits at any number of threads.
class PreconditionedSystem {
 public:
  // Keeps a reference to `pattern`.
  explicit PreconditionedSystem(const BlockPattern& pattern);

  // `blocks` in the order of the pattern, those of the diagonal whole. False
  // if no preconditioner has a factor.
  bool Factorize(std::vector<Eigen::Matrix3d> blocks, int num_threads);

  // Ends when |error|_A, by the preconditioner's estimate, has fallen to
  // `tolerance`, relative. An iteration reads A and the preconditioner once.
  Eigen::VectorXd Solve(const Eigen::VectorXd& rhs, double tolerance);

  Preconditioner preconditioner() const { return preconditioner_; }
  int num_iterations() const { return num_iterations_; }  // of the last Solve

  // What a factor and all that is solved with it are predicted to take, by an
  // operation of a dense factor in double precision.
  static double Cost(const BlockPattern& pattern);
  // With every preconditioner that it may come to.
  static int64_t MemoryBytes(const BlockPattern& pattern);

 private:
  void Whiten();
  bool IsNextCheaper(int num_iterations) const;
  void Escalate();
  bool FactorizePreconditioner();
  bool TryPreconditioner();
  template <typename Scalar>
  bool FactorizeDense(Scalar first_shift, DenseCholesky<Scalar>* factor);
  Eigen::VectorXd Precondition(const Eigen::VectorXd& residual) const;
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const;
  bool Iterate(Eigen::VectorXd residual, double tolerance, Eigen::VectorXd* y);

  const BlockPattern& pattern_;
  Preconditioner preconditioner_;
  int num_threads_ = 1;
  std::vector<Eigen::Matrix3d> blocks_;  // of W A W'
  std::vector<Eigen::Matrix3d> W_;       // per block column; lower triangles
  std::vector<int32_t> chunk_begin_;     // block columns of Multiply's parts
  IncompleteCholesky incomplete_;
  DenseCholesky<float> single_;
  DenseCholesky<double> double_;
  int num_iterations_ = 0;
  int most_iterations_ = 0;  // since the last Factorize
};

}  // namespace krot
