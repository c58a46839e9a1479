#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace krot::internal {

// R of A = Q R, 3x3 and upper triangular. An infinite number on the diagonal
// stands for a direction that no row of A tells: its unknown is 0.
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

// L^-1 of A = L L', lower triangular, of a positive definite 3x3 matrix. Pivots
// that are not above `least_pivot` > 0 are replaced by it; then it returns
// false.
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

}  // namespace krot::internal
