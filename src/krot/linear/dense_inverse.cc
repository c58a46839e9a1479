#include "krot/linear/dense_inverse.h"

#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Pivots below this share of the diagonal are rounding.
constexpr double kNoPivot = 1e-12;
constexpr int64_t kColumns = 64;  // per chunk of a parallel loop

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
  ParallelFor(
      size, kColumns, num_threads, [&](int64_t begin, int64_t end, int) {
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

}  // namespace krot::internal
