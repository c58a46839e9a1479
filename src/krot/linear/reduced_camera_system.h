#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "krot/base/context.h"
#include "krot/linear/blocks.h"
#include "krot/linear/native_kernels.h"

namespace krot::internal {

// An incomplete Cholesky factor, L L' ~ A, in single precision, for use as a
// preconditioner. A block column keeps only its largest blocks, half as many as
// A has there [Lin and More 1999]. They may be where A has none: as rows differ
// by decades, A's pattern does not show which blocks matter. Where such a
// factor does not exist, one of A + shift I does [Manteuffel 1980]; so the
// diagonal blocks of A should be about the identity.
class IncompleteCholesky {
 public:
  // `blocks` are A's, in the order of the pattern. False if no shift helps.
  bool Factorize(const BlockPattern& pattern,
                 const std::vector<Eigen::Matrix3d>& blocks);

  // (L L')^-1 rhs. Reads L twice.
  Eigen::VectorXf Solve(const Eigen::VectorXf& rhs) const;

  // At most this many additions and multiplications compute a factor.
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

  // L by columns; diagonal blocks are inverted.
  std::vector<int64_t> begin_;
  std::vector<Block> L_;
  float shift_ = 0;  // the last one that was enough
  // While the factor is made, column by column: column_ is the present column
  // j; place_ maps a row to its block in it (-1 if none); next_ has, for each
  // earlier column, its first block in a row >= j; waiting_ has, for each row,
  // the columns whose next_ block is in that row.
  std::vector<Block> column_;
  std::vector<int32_t> place_;
  std::vector<int64_t> next_;
  std::vector<std::vector<int32_t>> waiting_;
};

// Solves A x = b for a symmetric positive semidefinite A of 3x3 blocks, by
// conjugate gradients [Hestenes and Stiefel 1952] on
//
//   W A W' y = W b,   x = W'y,   W A_kk W' = I for every block k,
//
// preconditioned by an incomplete factor. That is of lower precision than the
// residuals, so the flexible variant is used [Notay 2000]. The same bits at any
// number of threads.
class ConjugateGradients {
 public:
  // The product of x with blocks of A that are not in the pattern.
  using Multiply = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;

  // `blocks` are in the order of the pattern; diagonal blocks have both
  // triangles. False if no incomplete factor exists. Without `has_factor` the
  // preconditioner is W alone. Keeps a reference to the pattern.
  bool Factorize(const BlockPattern& pattern,
                 std::vector<Eigen::Matrix3d> blocks, int num_threads,
                 bool has_factor = true);

  // Ends when the preconditioner's estimate of |error|_A has fallen to
  // `tolerance`, relative; false at the limit of iterations, beyond which it
  // would take too long, or never end. An iteration reads A and the
  // preconditioner once. `other_blocks` may be null.
  bool Solve(const Eigen::VectorXd& rhs, double tolerance, Eigen::VectorXd* x,
             int max_iterations = 2000, const Multiply& other_blocks = nullptr);

  int num_iterations() const { return num_iterations_; }  // of the last Solve

 private:
  void Whiten();
  Eigen::VectorXd Precondition(const Eigen::VectorXd& residual) const;
  Eigen::VectorXd MultiplyBlocks(const Eigen::VectorXd& x) const;
  Eigen::VectorXd Whitened(const Eigen::VectorXd& x) const;    // W x
  Eigen::VectorXd Unwhitened(const Eigen::VectorXd& y) const;  // W'y

  const BlockPattern* pattern_ = nullptr;
  int num_threads_ = 1;
  bool has_factor_ = true;
  std::vector<Eigen::Matrix3d> blocks_;  // of W A W'
  std::vector<Eigen::Matrix3d> W_;       // per block column; lower triangles
  IncompleteCholesky incomplete_;
  int num_iterations_ = 0;
};

// The normal equations of the frames, or of other parameters that points share,
// after the points are eliminated: symmetric, positive definite up to rounding,
// in 3x3 blocks. The matrix is a sum over points, which is taken in parts. The
// number and the order of parts depend only on the structure. More threads than
// parts do not make it faster.
//
// Usage: SetZero; AddBlock and SubtractSquare; Factorize; then Solve as often
// as necessary.
//
// Up to 500 frames it uses a dense Cholesky factor; with more, what is
// predicted to take the least time: a dense factor, a sparse one in a
// fill-reducing order, or conjugate gradients with an incomplete factor. With
// Use::kRoughSolutions, for one or two rough solutions of each matrix,
// conjugate gradients work without a factor and without the matrix
// (Kind::kImplicit): only its diagonal blocks are formed, and Solve gets a
// function that multiplies by the others.
class ReducedCameraSystem {
 public:
  enum class Use { kManySolutions, kRoughSolutions };

  // Where ranks share the points, each makes one, of its share.
  explicit ReducedCameraSystem(const BlockStructure& structure,
                               Ranks* ranks = nullptr,
                               Use use = Use::kManySolutions);

  enum class Kind { kDense, kSparse, kIterative, kImplicit };

  Kind kind() const { return kind_; }
  int num_parts() const { return static_cast<int>(parts_.size()); }
  int64_t num_columns() const { return num_columns_; }
  // The first column of a frame; -1 if it is fixed.
  int32_t column(int32_t frame) const { return column_of_frame_[frame]; }

  void SetZero();
  // The numbers of each part; there are num_numbers() in each.
  std::vector<std::vector<double>>* parts() { return &parts_; }
  int64_t num_numbers() const { return 9 * pattern_.num_blocks(); }
  // Adds a 3x3 block (column-major) at frames a, b with column(a) >=
  // column(b) >= 0. Different parts may be filled at the same time.
  void AddBlock(int part, int32_t a, int32_t b, const double block[9]);
  // Subtracts G'G, where G = [G_0 G_1 ...] has a block for each of the free
  // frames `frames`, ascending. Blocks of two frames that are both marked by
  // `is_apart` are left out. G is given by its three rows, each of
  // 3 * frames.size() numbers.
  void SubtractSquare(int part, const std::vector<int32_t>& frames,
                      const std::vector<char>& is_apart,
                      const double* const G[3]);

  // Adds up the parts into the first of them.
  void AddUpParts();
  // Adds up the parts, and factorises with growing regularisation until that
  // succeeds; false if it never does.
  bool Factorize(int num_threads);

  // The relative error in the energy norm is at most about `tolerance`, plus
  // rounding. If conjugate gradients do not converge, a dense factor replaces
  // them: at once or, if the matrix is not formed, from the next Factorize on.
  // Kind::kImplicit needs `other_blocks`.
  Eigen::VectorXd Solve(
      const Eigen::VectorXd& rhs, double tolerance,
      const ConjugateGradients::Multiply& other_blocks = nullptr);

  // The memory of a system of this structure, with its parts.
  int64_t MemoryBytes() const;

 private:
  // A block: three columns of three numbers, `stride` apart. Blocks of
  // consecutive frames in the same block column follow each other without gaps.
  struct Block {
    double* first;
    int64_t stride;
  };
  using SparseMatrix = Eigen::SparseMatrix<double>;

  double DenseCost() const;
  double IterativeCost(int num_iterations) const;
  double ImplicitCost(int num_iterations) const;
  double CostFormed(double cost) const;  // with that of forming the matrix
  Kind CheapestKind();
  Block BlockOf(int part, int32_t a, int32_t b);
  template <typename Visit>
  void ForEachRun(const Visit& visit) const;
  std::vector<Eigen::Matrix3d> Blocks() const;
  bool FactorizeDensely(double regularization);
  bool FactorizeSparsely(double regularization);
  bool FactorizeDirectly();
  void GoOnDensely();

  const Use use_;
  double num_observations_ = 0;
  double num_contributions_ = 0;  // of points to blocks
  Kind kind_ = Kind::kDense;
  int num_threads_ = 1;
  int64_t num_columns_ = 0;
  std::vector<int32_t> column_of_frame_;
  // Each part has every block column of the pattern as three columns of
  // numbers. After AddUpParts, parts_[0] is the sum.
  BlockPattern pattern_;
  BlockPattern pairs_;  // the whole pattern where pattern_ is the diagonal
  std::vector<std::vector<double>> parts_;
  DenseCholesky dense_;
  int64_t num_sparse_numbers_ = 0;
  SparseMatrix sparse_matrix_;
  Eigen::SimplicialLLT<SparseMatrix, Eigen::Lower, Eigen::AMDOrdering<int>>
      sparse_;
  ConjugateGradients iterative_;
  int most_iterations_ = 0;  // largest of all Solves since the last Factorize
};

}  // namespace krot::internal
