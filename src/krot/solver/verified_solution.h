#pragma once

#include <optional>

#include <Eigen/Core>

namespace krot {

// An under-determined system M a = -g that is known approximately: the true
// matrix is within `M_error` of `M`, the true |g| within `g_bound`, entry by
// entry.
struct UncertainSystem {
  Eigen::MatrixXd M;        // rows x columns, rows <= columns
  Eigen::MatrixXd M_error;  // >= 0
  Eigen::VectorXd g_bound;  // >= 0
};

// Proves that every such system has a solution, and bounds one: |a| <= the
// result, entry by entry, all roundings accounted for.
//
// Let X be an approximate right inverse and E = I - M X. If |E|_inf = alpha < 1
// then a = -X (I - E)^-1 g exists, solves M a = -g, and
//
//   |a| <= |X| (|g| + alpha / (1 - alpha) |g|_inf)      entry by entry.
//
// None if alpha cannot be shown to be below 1/2: M has not full row rank, or
// too nearly so for double precision. Rows are scaled by powers of two first,
// which changes neither solutions nor bits. O(rows^2 columns).
std::optional<Eigen::VectorXd> BoundSolution(UncertainSystem system);

}  // namespace krot
