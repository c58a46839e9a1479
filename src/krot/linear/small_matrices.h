#pragma once

#include <Eigen/Core>

namespace krot::internal {

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
