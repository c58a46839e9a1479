#pragma once

#include <cstdint>

namespace krot {

// Plain memory, no Eigen: this header is shared with code compiled for other
// vector units.

inline constexpr int kResidualLanes = 8;

// A row of a residual [Zhang18, (2), (3)]: a_1, b_1, a_2, b_2, c, d.
inline constexpr int kResidualRow = 12;

// Eight residuals side by side, one of them per lane.
struct alignas(64) ResidualBlock {
  double row[kResidualRow][kResidualLanes];
};

// values[i] = r_i(x) for all lanes of `num_blocks` blocks (infinity unless
// the depth is positive); returns the largest. p >= 1 or infinity. About 1 ns
// per residual for p = 2.
double EvaluateResiduals(const ResidualBlock* blocks, int64_t num_blocks,
                         double p, const double x[3], double* values);

}  // namespace krot
