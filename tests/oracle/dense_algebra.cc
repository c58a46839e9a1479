#include "tests/oracle/dense_algebra.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace krot::internal {

// Large rows go first, as graded rows require.
LongMatrix LeastNormSolution(const LongMatrix& A, const LongMatrix& B) {
  std::vector<Eigen::Index> order(A.rows());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    return A.row(a).squaredNorm() > A.row(b).squaredNorm();
  });
  LongMatrix sorted(A.rows(), A.cols()), rhs(B.rows(), B.cols());
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    sorted.row(i) = A.row(order[i]);
    rhs.row(i) = B.row(order[i]);
  }
  return Eigen::CompleteOrthogonalDecomposition<LongMatrix>(sorted).solve(rhs);
}

Eigen::MatrixXd SolveByLu(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  return Eigen::PartialPivLU<Eigen::MatrixXd>(A).solve(B);
}

Eigen::MatrixXd CholeskyFactor(const Eigen::MatrixXd& A) {
  return Eigen::LLT<Eigen::MatrixXd>(A).matrixL();
}

SymmetricEigen EigenOfSymmetric(const Eigen::MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

LongVector SingularValues(const LongMatrix& A) {
  return Eigen::JacobiSVD<LongMatrix>(A).singularValues();
}

}  // namespace krot::internal
