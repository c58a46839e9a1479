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
  // What blocks that do not stand in the pattern add to A x.
  using Multiply = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;

  // `blocks` in the order of the pattern, those of the diagonal whole. False if
  // there is no preconditioner; without `has_factor` it is W alone. Keeps a
  // reference to the pattern.
  bool Factorize(const BlockPattern& pattern,
                 std::vector<Eigen::Matrix3d> blocks, int num_threads,
                 bool has_factor = true);

  // Ends when |error|_A, by the preconditioner's estimate, has fallen to
  // `tolerance`, relative; false if it does not within `max_iterations`, each
  // of which reads A and the preconditioner once. By default more would not end
  // either, or not soon.
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

// The normal equations of the frames, or of whatever else points share, once
// the points are eliminated: symmetric, positive definite up to rounding, in
// 3x3 blocks. Its matrix is a sum over points, which is taken in parts: how
// many and in which order depends on the structure alone. More threads than
// parts do not make it faster.
//
//   SetZero; AddBlock and SubtractSquare; Factorize; Solve as often as need be
//
// Up to a few hundred frames it has a dense Cholesky factor; with more,
// whatever is predicted to take the least time: a dense one, a sparse one in a
// fill-reducing order, or conjugate gradients with an incomplete one. For one
// or two rough solutions of each matrix, conjugate gradients do without a
// factor, and without the matrix: its blocks on the diagonal are all that is
// formed (Kind::kImplicit), and Solve is told how to multiply by the others.
class ReducedCameraSystem {
 public:
  enum class Use { kManySolutions, kRoughSolutions };

  // Where ranks share the points they make one each, of their shares.
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
  // The numbers of each part, as many as num_numbers().
  std::vector<std::vector<double>>* parts() { return &parts_; }
  int64_t num_numbers() const { return 9 * pattern_.num_blocks(); }
  // Adds a 3x3 block (column-major) at frames a, b with column(a) >=
  // column(b) >= 0. Different parts may be filled at the same time.
  void AddBlock(int part, int32_t a, int32_t b, const double block[9]);
  // Subtracts G'G, G = [G_0 G_1 ...] standing for the free frames
  // `frames`, ascending, but for the blocks of two frames that `is_apart`
  // marks. G is given by its three rows of 3 x frames.size() numbers.
  void SubtractSquare(int part, const std::vector<int32_t>& frames,
                      const std::vector<char>& is_apart,
                      const double* const G[3]);

  // Into the first of the parts.
  void AddUpParts();
  // Adds up the parts, and factorises with growing regularisation until there
  // is a factor; false if there never is.
  bool Factorize(int num_threads);

  // The relative error in the energy norm is about `tolerance` at most, and
  // that of rounding. Where conjugate gradients do not end, a dense factor
  // takes their place: at once or, if the matrix was not formed, from the next
  // Factorize on. `other_blocks` serves Kind::kImplicit.
  Eigen::VectorXd Solve(
      const Eigen::VectorXd& rhs, double tolerance,
      const ConjugateGradients::Multiply& other_blocks = nullptr);

  // What a system of this structure occupies, with its parts.
  int64_t MemoryBytes() const;

 private:
  // A block: three columns of three numbers, `stride` apart. Of frames that
  // follow each other the blocks of one column do too, without a gap.
  struct Block {
    double* first;
    int64_t stride;
  };
  using SparseMatrix = Eigen::SparseMatrix<double>;

  double DenseCost() const;
  double IterativeCost(int num_iterations) const;
  double ImplicitCost(int num_iterations) const;
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
  Kind kind_ = Kind::kDense;
  int num_threads_ = 1;
  int64_t num_columns_ = 0;
  std::vector<int32_t> column_of_frame_;
  // Per part, each block column of the pattern as three columns of numbers.
  // Once they are added up, parts_[0] is the sum.
  BlockPattern pattern_;
  BlockPattern pairs_;  // the whole pattern where pattern_ is the diagonal
  std::vector<std::vector<double>> parts_;
  DenseCholesky dense_;
  int64_t num_sparse_numbers_ = 0;
  SparseMatrix sparse_matrix_;
  Eigen::SimplicialLLT<SparseMatrix, Eigen::Lower, Eigen::AMDOrdering<int>>
      sparse_;
  ConjugateGradients iterative_;
  int most_iterations_ = 0;  // of a Solve since the last Factorize
};

}  // namespace krot::internal
