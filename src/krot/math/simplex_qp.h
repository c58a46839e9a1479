#pragma once

#include <vector>

#include <Eigen/Core>

namespace krot::internal {

// A linear piece `value + gradient . d` of a function of the step d.
struct LinearPiece {
  double value = 0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

// The minimiser of  max_i (value_i + gradient_i . d) + 1/2 |d|^2  over d in
// R^3, found in its dual
//
//   min over mu >= 0, sum mu = 1   1/2 |sum mu_i gradient_i|^2
//                                  - sum mu_i value_i,
//
// with d = -sum mu_i gradient_i.
//
// With all values equal, -d is the point of least norm of the convex hull of
// the gradients.
struct SimplexQpSolution {
  Eigen::Vector3d step = Eigen::Vector3d::Zero();  // d
  double level = 0;  // max_i (value_i + gradient_i . d)
  // The pieces that attain the maximum: at most 4, affinely independent.
  int size = 0;
  int index[4] = {0, 0, 0, 0};
  double weight[4] = {0, 0, 0, 0};  // mu > 0, sum 1
};

// Wolfe's active-set method for the nearest point of a polytope [Wolfe 1976],
// extended by the linear term. Requires count >= 1 and finite pieces. A
// previous solution in `*solution` (size > 0, indices still valid) serves as a
// warm start. Exact up to rounding, as each active set is visited at most once.
// O(count) per change of the active set.
void SolveSimplexQp(const LinearPiece* pieces, int count,
                    SimplexQpSolution* solution);

// The point of least norm of the convex hull of `count` >= 1 vectors. `scratch`
// is memory that callers keep between calls.
Eigen::Vector3d MinNormPoint(const Eigen::Vector3d* vectors, int count,
                             std::vector<LinearPiece>* scratch);

}  // namespace krot::internal
