#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"

namespace krot::internal {

// Least squares of bundle adjustment, in blocks of three columns: those of
// points, and those of frames or of other parameters that points share.

// Which frame each observation belongs to. Observations are sorted by point.
struct BlockStructure {
  std::vector<int64_t> point_begin;  // num_points + 1
  std::vector<int32_t> frame_of;     // per observation
  std::vector<char> frame_is_fixed;  // per frame; a fixed one has no columns
  std::vector<char> point_is_fixed;  // per point, likewise; empty: none is

  bool IsFixedPoint(int64_t k) const {
    return !point_is_fixed.empty() && point_is_fixed[k] != 0;
  }
  int64_t num_points() const {
    return static_cast<int64_t>(point_begin.size()) - 1;
  }
  int64_t num_observations() const { return point_begin.back(); }
  int64_t num_frames() const {
    return static_cast<int64_t>(frame_is_fixed.size());
  }
};

// Each point's observations sorted by frame, and by index for the same frame.
// From point_begin[k] on there are the observations of point k, as offsets from
// point_begin[k].
std::vector<int32_t> OrderByFrame(const BlockStructure& structure);

// A number for every column.
struct BlockVector {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> frames;

  void SetZero(int64_t num_points, int64_t num_frames) {
    points.assign(num_points, Eigen::Vector3d::Zero());
    frames.assign(num_frames, Eigen::Vector3d::Zero());
  }
  double Dot(const BlockVector& other) const;
  void Add(double factor, const BlockVector& other);  // += factor * other
};

// The nonzero 3x3 blocks in the lower triangle of a symmetric matrix: for each
// block column its block rows, ascending, beginning with the diagonal block.
struct BlockPattern {
  std::vector<int64_t> begin = {0};  // num_columns + 1
  std::vector<int32_t> row;          // per block

  int32_t num_columns() const { return static_cast<int32_t>(begin.size()) - 1; }
  int64_t num_blocks() const { return static_cast<int64_t>(row.size()); }
  bool operator==(const BlockPattern& other) const {
    return begin == other.begin && row == other.row;
  }
};

BlockPattern FullPattern(int32_t num_columns);

// The pattern with a block for every pair of free frames that share a point, on
// any rank where ranks share the points. Block columns are the free frames.
// O(sum of the squared lengths of tracks).
BlockPattern PairsThatSharePoints(const BlockStructure& structure,
                                  Ranks* ranks = nullptr);

// The size of the sparse Cholesky factor of a matrix of this pattern, in
// Eigen's fill-reducing order. Found by a symbolic factorisation with one
// number per block, which costs next to nothing beside the factor itself.
struct SparseFactorSize {
  int64_t numbers;
  double operations;  // additions and multiplications to compute it
};
SparseFactorSize FindSparseFactorSize(const BlockPattern& pattern);

// R of A = Q R, 3x3 and upper triangular. An infinite number on the diagonal
// marks an unknown that no row of A determines: solutions set it to 0.
struct UpperTriangle {
  double r00 = 0, r01 = 0, r02 = 0, r11 = 0, r12 = 0, r22 = 0;

  Eigen::Vector3d Solve(const Eigen::Vector3d& b) const {  // R^-1 b
    Eigen::Vector3d x;
    x[2] = b[2] / r22;
    x[1] = (b[1] - r12 * x[2]) / r11;
    x[0] = (b[0] - r01 * x[1] - r02 * x[2]) / r00;
    return x;
  }
  Eigen::Vector3d SolveTransposed(const Eigen::Vector3d& b) const {  // R^-T b
    Eigen::Vector3d x;
    x[0] = b[0] / r00;
    x[1] = (b[1] - r01 * x[0]) / r11;
    x[2] = (b[2] - r02 * x[0] - r12 * x[1]) / r22;
    return x;
  }
};

// A = Q R by Gram-Schmidt with reorthogonalisation, in place: `rows` holds A,
// n x 3 and row-major, and Q afterwards. A column that is a combination of the
// ones before it, up to rounding, becomes 0 in Q. O(n).
UpperTriangle Orthogonalize(int64_t n, double* rows);

// Computes L^-1, lower triangular, for A = L L', a positive definite 3x3
// matrix. Pivots that are not above `least_pivot` > 0 are replaced by it, and
// then the function returns false.
template <typename Scalar>
bool InvertCholesky(const Eigen::Matrix<Scalar, 3, 3>& A, Scalar least_pivot,
                    Eigen::Matrix<Scalar, 3, 3>* inverse) {
  bool is_exact = true;
  const auto inverse_root = [&](Scalar pivot) {
    is_exact = is_exact && pivot > least_pivot;
    return 1 / std::sqrt(pivot > least_pivot ? pivot : least_pivot);
  };
  const Scalar i00 = inverse_root(A(0, 0));
  const Scalar l10 = A(1, 0) * i00;
  const Scalar l20 = A(2, 0) * i00;
  const Scalar i11 = inverse_root(A(1, 1) - l10 * l10);
  const Scalar l21 = (A(2, 1) - l20 * l10) * i11;
  const Scalar i22 = inverse_root(A(2, 2) - l20 * l20 - l21 * l21);
  const Scalar i10 = -l10 * i00 * i11;
  *inverse << i00, 0, 0,  //
      i10, i11, 0,        //
      -(l20 * i00 + l21 * i10) * i22, -l21 * i11 * i22, i22;
  return is_exact;
}

// Replaces a symmetric positive semidefinite matrix by a generalised inverse,
// on all threads: redundant unknowns are held at 0. Returns a basis of its null
// space, as columns; there are none if it is positive definite. A pivot counts
// as 0 if it is below 1e-12 of its own diagonal element or, once the matrix is
// known to be singular, of the largest one. So unknowns should have units in
// which diagonal elements are of similar size. O(n^3), several times as long
// for a singular matrix. The same bits at any number of threads.
Eigen::MatrixXd InvertSemidefinite(int num_threads, Eigen::MatrixXd* matrix);

// Eigen's decompositions of small matrices, each compiled once here, since one
// alone takes the compiler seconds.

// Of a symmetric matrix.
struct Eigenpairs {
  Eigen::VectorXd values;   // ascending
  Eigen::MatrixXd vectors;  // columns, orthonormal
};
Eigenpairs EigenpairsOf(const Eigen::MatrixXd& A);

// -M^+ g in the directions that are determined; M is symmetric. As unknowns
// have different units, its diagonal is scaled to 1 first: nothing determines
// directions whose eigenvalues are below 1e-9 then.
template <typename Vector, typename Matrix>
Vector DeterminedStep(const Matrix& M, const Vector& g) {
  Vector scale = M.diagonal().cwiseMax(0).cwiseSqrt();
  for (double& s : scale) s = s > 0 ? 1 / s : 0;
  const Eigenpairs of_M =
      EigenpairsOf(scale.asDiagonal() * M * scale.asDiagonal());
  Vector y = of_M.vectors.transpose() * scale.cwiseProduct(g);
  for (Eigen::Index j = 0; j < y.size(); ++j) {
    const double value = of_M.values[j];
    y[j] = value > 1e-9 ? -y[j] / value : 0;
  }
  return scale.cwiseProduct(of_M.vectors * y);
}

// By LU with complete pivoting.
struct LuInverse {
  bool exists = false;
  Eigen::MatrixXd matrix;
  // Estimate of the reciprocal of A's condition number in the 1-norm.
  double rcond = 0;
};
LuInverse InverseOf(const Eigen::MatrixXd& A);

}  // namespace krot::internal
