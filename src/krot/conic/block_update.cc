#include "krot/conic/block_update.h"

namespace krot {
namespace {

// column -= s0 g0 + s1 g1 + s2 g2.
inline void SubtractFromColumn(const double* __restrict g0,
                               const double* __restrict g1,
                               const double* __restrict g2, double s0,
                               double s1, double s2, int64_t n,
                               double* __restrict column) {
  for (int64_t k = 0; k < n; ++k) {
    column[k] -= s0 * g0[k] + s1 * g1[k] + s2 * g2[k];
  }
}

}  // namespace

void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride) {
  for (int j = 0; j < 3; ++j) {
    SubtractFromColumn(g[0], g[1], g[2], s[j], s[3 + j], s[6 + j], n,
                       first_column + j * stride);
  }
}

}  // namespace krot
