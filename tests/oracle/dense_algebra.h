#pragma once

#include <Eigen/Core>

namespace krot::internal {

// Dense linear algebra that tests compare with: Eigen's decompositions, each
// compiled once here, since one alone takes the compiler seconds.

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

// A^+ B, the matrix X of least norm among those that minimise |A X - B|: by a
// complete orthogonal decomposition in long double. A has any shape and rank,
// and its rows may be graded.
LongMatrix LeastNormSolution(const LongMatrix& A, const LongMatrix& B);

// A^-1 B for a regular matrix, by LU decomposition.
Eigen::MatrixXd SolveByLu(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

// The lower triangular L of L L' = A for a positive definite matrix.
Eigen::MatrixXd CholeskyFactor(const Eigen::MatrixXd& A);

struct SymmetricEigen {
  Eigen::VectorXd values;   // ascending
  Eigen::MatrixXd vectors;  // columns, orthonormal
};
SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& A);

// Descending.
LongVector SingularValues(const LongMatrix& A);

}  // namespace krot::internal
