#include "krot/linear/triangle.h"

#include <cmath>
#include <limits>

namespace krot::internal {
namespace {

// A column that keeps less than this share of its norm is a combination of the
// ones before it.
constexpr double kRankTolerance = 1e-13;

// column -= q q'column; returns q'column. Done twice, Gram-Schmidt is as
// orthogonal as Householder's reflections [Giraud, Langou, Rozloznik 2005].
double Subtract(const double* q, int64_t n, double* column) {
  double dot = 0;
  for (int64_t i = 0; i < n; ++i) dot += q[3 * i] * column[3 * i];
  for (int64_t i = 0; i < n; ++i) column[3 * i] -= dot * q[3 * i];
  return dot;
}

double ColumnNorm(const double* column, int64_t n) {
  double sum = 0;
  for (int64_t i = 0; i < n; ++i) sum += column[3 * i] * column[3 * i];
  return std::sqrt(sum);
}

}  // namespace

UpperTriangle Orthogonalize(int64_t n, double* rows) {
  double R[3][3] = {};
  for (int c = 0; c < 3; ++c) {
    const double norm_before = ColumnNorm(rows + c, n);
    for (int pass = 0; pass < 2; ++pass) {
      for (int b = 0; b < c; ++b) R[b][c] += Subtract(rows + b, n, rows + c);
    }
    const double norm = ColumnNorm(rows + c, n);
    const bool is_free = !(norm > kRankTolerance * norm_before);
    R[c][c] = is_free ? std::numeric_limits<double>::infinity() : norm;
    const double scale = is_free ? 0 : 1 / norm;
    for (int64_t i = 0; i < n; ++i) rows[3 * i + c] *= scale;
  }
  return {R[0][0], R[0][1], R[0][2], R[1][1], R[1][2], R[2][2]};
}

}  // namespace krot::internal
