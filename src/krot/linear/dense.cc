#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "krot/base/parallel_for.h"
#include "krot/base/system.h"
#include "krot/linear/blocks.h"
#include "krot/linear/native_kernels.h"

namespace krot::internal {

KROT_DECLARE_KERNELS(LinearKernels, kLinearKernels)

namespace {

// With tiles of 192, Eigen's products take 1.5 times as long per number; tiles
// of 96 and 160 are in between.
constexpr int64_t kTile = 128;

const LinearKernels& Kernels() { return KROT_BEST_KERNELS(kLinearKernels); }

}  // namespace

void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride) {
  static const auto subtract = Kernels().subtract_from_columns;
  subtract(g, s, n, first_column, stride);
}

int64_t DenseCholesky::NumTiles() const { return NumChunks(size_, kTile); }

int64_t DenseCholesky::Size(int64_t i) const {
  return std::min(kTile, size_ - i * kTile);
}

int64_t DenseCholesky::stride() const { return std::min(kTile, size_); }

MatrixTile DenseCholesky::Tile(int64_t i, int64_t j) const {
  return {&tiles_[(i * (i + 1) / 2 + j) * stride() * stride()], Size(i),
          Size(j), stride()};
}

void DenseCholesky::SetZero(int64_t num_columns) {
  size_ = num_columns;
  tiles_.assign(NumTiles() * (NumTiles() + 1) / 2 * stride() * stride(), 0);
}

double& DenseCholesky::At(int64_t row, int64_t column) {
  const double* const tile = Tile(row / kTile, column / kTile).numbers;
  return tiles_[tile - tiles_.data() + column % kTile * stride() + row % kTile];
}

void DenseCholesky::SetRun(int64_t row, int64_t column, int64_t count,
                           const double* numbers) {
  for (int64_t n = 0; n < count;) {
    const int64_t in_tile = std::min(count - n, kTile - (row + n) % kTile);
    std::copy_n(numbers + n, in_tile, &At(row + n, column));
    n += in_tile;
  }
}

bool DenseCholesky::Factorize(int num_threads) {
  num_threads_ = num_threads;
  const LinearKernels& kernels = Kernels();
  const int64_t num_tiles = NumTiles();
  std::vector<std::pair<int64_t, int64_t>> rest;
  for (int64_t k = 0; k < num_tiles; ++k) {
    if (!kernels.factorize(Tile(k, k))) return false;
    ParallelFor(
        num_tiles - k - 1, 1, num_threads, [&](int64_t below, int64_t, int) {
          kernels.divide_by_transposed(Tile(k, k), Tile(k + 1 + below, k));
        });
    rest.clear();
    for (int64_t i = k + 1; i < num_tiles; ++i) {
      for (int64_t j = k + 1; j <= i; ++j) rest.emplace_back(i, j);
    }
    ParallelFor(static_cast<int64_t>(rest.size()), 1, num_threads,
                [&](int64_t n, int64_t, int) {
                  const auto [i, j] = rest[n];
                  kernels.subtract_product(Tile(i, k), Tile(j, k), Tile(i, j));
                });
  }
  return true;
}

// Computes L^-1 x, then L'^-1 of that. Each tile of x, once it is final, is
// subtracted from all others that depend on it.
void DenseCholesky::Solve(double* x) const {
  // Waking another thread takes longer than its share of a small system.
  const int num_threads = size_ < 1000 ? 1 : num_threads_;
  const LinearKernels& kernels = Kernels();
  const auto part = [&](int64_t i) { return x + i * kTile; };
  const int64_t num_tiles = NumTiles();
  for (int64_t j = 0; j < num_tiles; ++j) {
    kernels.divide(Tile(j, j), false, part(j));
    ParallelFor(num_tiles - j - 1, 1, num_threads,
                [&](int64_t below, int64_t, int) {
                  const int64_t i = j + 1 + below;
                  kernels.subtract_times(Tile(i, j), false, part(j), part(i));
                });
  }
  for (int64_t i = num_tiles - 1; i >= 0; --i) {
    kernels.divide(Tile(i, i), true, part(i));
    ParallelFor(i, 1, num_threads, [&](int64_t j, int64_t, int) {
      kernels.subtract_times(Tile(i, j), true, part(i), part(j));
    });
  }
}

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Pivots below this share of the diagonal are rounding.
constexpr double kNoPivot = 1e-12;

// Replaces a positive definite matrix by its inverse, by columns on all
// threads. False, with the matrix as it was, if a pivot is not above
// `least_pivot` times its diagonal element.
bool Invert(int num_threads, double least_pivot, MatrixXd* matrix) {
  const Index size = matrix->rows();
  const VectorXd diagonal = matrix->diagonal();
  Eigen::LLT<MatrixXd> llt(*matrix);
  if (llt.info() != Eigen::Success) return false;
  const MatrixXd& L = llt.matrixLLT();
  for (Index n = 0; n < size; ++n) {
    if (!(L(n, n) * L(n, n) > least_pivot * diagonal[n])) return false;
  }
  ParallelFor(size, 64, num_threads, [&](int64_t begin, int64_t end, int) {
    MatrixXd columns = MatrixXd::Zero(size, end - begin);
    for (Index n = begin; n < end; ++n) columns(n, n - begin) = 1;
    auto below = columns.bottomRows(size - begin);
    L.bottomRightCorner(size - begin, size - begin)
        .triangularView<Eigen::Lower>()
        .solveInPlace(below);
    L.transpose().triangularView<Eigen::Upper>().solveInPlace(columns);
    matrix->middleCols(begin, end - begin) = columns;
  });
  return true;
}

// Orders the unknowns so that the rows of the first `*rank` span all rows, by a
// Cholesky factorisation that takes the largest pivot first.
std::vector<Index> OrderByPivots(const MatrixXd& matrix, Index* rank) {
  const Index size = matrix.rows();
  std::vector<Index> order(size);
  std::iota(order.begin(), order.end(), Index{0});
  VectorXd rest = matrix.diagonal();
  const double least = kNoPivot * rest.maxCoeff();
  MatrixXd L = MatrixXd::Zero(size, size);
  for (*rank = 0; *rank < size; ++*rank) {
    const Index k = *rank;
    Index p = 0;
    if (!(rest.tail(size - k).maxCoeff(&p) > least)) break;
    p += k;
    std::swap(order[p], order[k]);
    std::swap(rest[p], rest[k]);
    L.row(p).swap(L.row(k));
    const Index below = size - k - 1;
    VectorXd column(below);
    for (Index r = 0; r < below; ++r) {
      column[r] = matrix(order[k + 1 + r], order[k]);
    }
    column.noalias() -=
        L.block(k + 1, 0, below, k) * L.row(k).head(k).transpose();
    column /= std::sqrt(rest[k]);
    rest.tail(below) -= column.cwiseAbs2();
    L.col(k).tail(below) = column;
  }
  return order;
}

}  // namespace

MatrixXd InvertSemidefinite(int num_threads, MatrixXd* matrix) {
  const Index size = matrix->rows();
  MatrixXd inverse = *matrix;
  if (size == 0 || Invert(num_threads, kNoPivot, &inverse)) {
    matrix->swap(inverse);
    return MatrixXd(size, 0);
  }
  Index rank = 0;
  const std::vector<Index> order = OrderByPivots(*matrix, &rank);
  MatrixXd kept, others;
  for (;; --rank) {
    kept.resize(rank, rank);
    others.resize(rank, size - rank);
    for (Index a = 0; a < rank; ++a) {
      for (Index b = 0; b < size; ++b) {
        (b < rank ? kept(a, b) : others(a, b - rank)) =
            (*matrix)(order[a], order[b]);
      }
    }
    if (rank == 0 || Invert(num_threads, 0, &kept)) break;
  }
  const MatrixXd follow = -kept * others;
  MatrixXd motions = MatrixXd::Zero(size, size - rank);
  matrix->setZero();
  for (Index a = 0; a < size; ++a) {
    if (a >= rank) {
      motions(order[a], a - rank) = 1;
      continue;
    }
    motions.row(order[a]) = follow.row(a);
    for (Index b = 0; b < rank; ++b) {
      (*matrix)(order[b], order[a]) = kept(b, a);
    }
  }
  return motions;
}

Eigenpairs EigenpairsOf(const MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

LuInverse InverseOf(const MatrixXd& A) {
  const Eigen::FullPivLU<MatrixXd> lu(A);
  return {lu.isInvertible(), lu.inverse(), lu.rcond()};
}

}  // namespace krot::internal
