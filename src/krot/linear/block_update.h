#pragma once

#include <cstdint>

namespace krot {

// Three columns of a matrix, `stride` numbers apart, lose G'S:
//
//   column_j[k] -= sum_r s[3 r + j] g_r[k],   k < n, j < 3,
//
// g_r being the rows of G (3 x n) and s those of S (3 x 3). The innermost loop
// of the frames' system, compiled for the machine at hand; no Eigen type in its
// interface. The columns overlap neither each other nor G.
void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride);

}  // namespace krot
