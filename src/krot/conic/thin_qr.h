#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace krot {

// R of A = Q R, upper triangular. An infinite entry on the diagonal stands for
// a free direction: nothing answers to it.
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
// n x 3 and row-major, and Q afterwards. A column that all but vanishes beside
// the ones before it, being their combination, becomes 0 in Q. O(n).
UpperTriangle Orthogonalize(int64_t n, double* rows);

}  // namespace krot
