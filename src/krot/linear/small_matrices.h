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

// By LU with complete pivoting.
struct LuInverse {
  bool exists = false;
  Eigen::MatrixXd matrix;
  // Estimate of the reciprocal of A's condition number in the 1-norm.
  double rcond = 0;
};
LuInverse InverseOf(const Eigen::MatrixXd& A);

}  // namespace krot::internal
