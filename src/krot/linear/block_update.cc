#include "krot/linear/block_update.h"

#include <cstring>

namespace krot {
namespace {

// So many numbers side by side. Runs are short, often of six: compilers that
// vectorise the loop over them by themselves are half as fast.
using Two = double __attribute__((vector_size(16)));
using Four = double __attribute__((vector_size(32)));

template <typename Numbers>
inline void SubtractNumbers(const double* const g[3], const double s[9],
                            int64_t k, double* first_column, int64_t stride) {
  Numbers g0, g1, g2;
  std::memcpy(&g0, g[0] + k, sizeof(Numbers));
  std::memcpy(&g1, g[1] + k, sizeof(Numbers));
  std::memcpy(&g2, g[2] + k, sizeof(Numbers));
  for (int j = 0; j < 3; ++j) {
    double* const to = first_column + j * stride + k;
    Numbers column;
    std::memcpy(&column, to, sizeof(Numbers));
    column -= s[j] * g0 + s[3 + j] * g1 + s[6 + j] * g2;
    std::memcpy(to, &column, sizeof(Numbers));
  }
}

}  // namespace

void SubtractFromColumns(const double* const g[3], const double s[9], int64_t n,
                         double* first_column, int64_t stride) {
  double local[9];  // which the columns do not overlap
  std::memcpy(local, s, sizeof(local));
  const double* const rows[3] = {g[0], g[1], g[2]};
  int64_t k = 0;
  for (; k + 4 <= n; k += 4) {
    SubtractNumbers<Four>(rows, local, k, first_column, stride);
  }
  if (k + 2 <= n) {
    SubtractNumbers<Two>(rows, local, k, first_column, stride);
    k += 2;
  }
  if (k < n) SubtractNumbers<double>(rows, local, k, first_column, stride);
}

}  // namespace krot
