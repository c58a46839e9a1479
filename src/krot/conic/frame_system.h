#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "krot/base/ranks.h"
#include "krot/conic/block_pattern.h"
#include "krot/conic/block_structure.h"
#include "krot/conic/dense_cholesky.h"
#include "krot/conic/frame_pattern.h"
#include "krot/conic/preconditioned_system.h"

namespace krot {

// The normal equations of the frames once the points are eliminated, or of
// whatever else comes in threes of columns (adjust/barrier_system.h): 3x3
// blocks, symmetric, positive definite up to rounding. For a few hundred frames
// it is dense; for more, whatever is predicted to take the least time: a sparse
// factor in a fill-reducing order, or conjugate gradients
// (preconditioned_system.h).
//
// The sum over points is taken in `num_parts` parts, whose number and order
// depend on the structure alone: the same bits at any number of threads. More
// threads than parts, four or, for many frames, fewer, do not make it faster.
class FrameSystem {
 public:
  // Where ranks share the points they make one each, of their shares.
  explicit FrameSystem(const BlockStructure& structure, Ranks* ranks = nullptr);

  enum class Kind { kDense, kSparse, kPreconditioned };

  Kind kind() const { return kind_; }
  int num_parts() const { return num_parts_; }
  int64_t num_columns() const { return num_columns_; }
  // The first column of a frame; -1 if it is fixed.
  int32_t column(int32_t frame) const { return column_of_frame_[frame]; }

  void SetZero();
  void SetZero(int part);
  // A part of the sum as numbers, and back.
  std::vector<double> Part(int part) const;
  void SetPart(int part, const std::vector<double>& numbers);
  // Adds a 3x3 block (column-major) at frames a, b with column(a) >=
  // column(b) >= 0. Different parts may be filled at the same time.
  void AddBlock(int part, int32_t a, int32_t b, const double block[9]);
  // Subtracts G'G, G = [G_0 G_1 ...] standing for the free frames
  // `frames`, ascending, but for the blocks of two frames that `is_apart`
  // marks. G is given by its three rows of 3 x frames.size() numbers.
  void SubtractSquare(int part, const std::vector<int32_t>& frames,
                      const std::vector<char>& is_apart,
                      const double* const G[3]);

  // Cholesky factor, or preconditioner, of the sum of the parts, with growing
  // regularisation until it exists; false if it never does.
  bool Factorize(int num_threads);
  // The error in the energy norm is about `tolerance` at most, relative, and
  // rounding's.
  Eigen::VectorXd Solve(const Eigen::VectorXd& rhs,
                        double tolerance = 1e-10) const;

  // What a system of this structure will occupy.
  int64_t MemoryBytes() const;

 private:
  // A block: three columns of three numbers, `stride` apart. Of frames that
  // follow each other the blocks of one column do too, without a gap.
  struct Block {
    double* first;
    int64_t stride;
  };

  bool is_dense() const { return kind_ == Kind::kDense; }
  void TakePattern(const FramePattern& pattern);
  Block BlockOf(int part, int32_t a, int32_t b);
  void SumDense(int num_threads);
  void SumSparse();
  std::vector<Eigen::Matrix3d> SumBlocks() const;
  bool FactorizeRegularized(int num_threads);

  Kind kind_ = Kind::kDense;
  int num_parts_ = 1;
  int64_t num_columns_ = 0;
  std::vector<int32_t> column_of_frame_;
  // Dense.
  std::vector<Eigen::MatrixXd> dense_;  // per part; lower triangle
  DenseCholesky<double> dense_factor_;
  // Otherwise by block columns: per part, three columns of numbers for each.
  BlockPattern pattern_;
  std::vector<std::vector<double>> values_;
  // Of these, sparse.
  int64_t num_factor_numbers_ = 0;
  Eigen::SparseMatrix<double> sparse_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower,
                       Eigen::AMDOrdering<int>>
      sparse_factor_;
  bool is_analyzed_ = false;
  // Or by iterations.
  std::unique_ptr<PreconditionedSystem> preconditioned_;
};

}  // namespace krot
