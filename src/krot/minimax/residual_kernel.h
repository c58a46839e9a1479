#pragma once

#include <cstdint>

namespace krot::internal {

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

// Eight residuals side by side, differentiated.
struct alignas(64) GradientBlock {
  double value[kResidualLanes];
  double gradient[3][kResidualLanes];
  double depth[kResidualLanes];
  // The Hessian for the depth held fixed is curvature * bend * bend'.
  double curvature[kResidualLanes];
  double bend[3][kResidualLanes];
};

// For p = 2, all lanes of `num_blocks` blocks and positive depths: r_i(x) and
// its derivatives (0 where r_i = 0, which has none).
void EvaluateGradients(const ResidualBlock* blocks, int64_t num_blocks,
                       const double x[3], GradientBlock* gradients);

// The largest share of the step d, at most 1, on which no depth falls below
// `lowest` of what it is at x; all must be positive. 0 <= lowest < 1.
double DepthShare(const ResidualBlock* blocks, int64_t num_blocks,
                  const double x[3], const double d[3], double lowest);

// The upper triangle, row by row, of
//   sum_i (A_i'A_i + cost^2 c_i c_i') / w_i^2
// over all lanes of `num_blocks` blocks; all depths must be positive.
void SumMetric(const ResidualBlock* blocks, int64_t num_blocks,
               const double x[3], double cost, double metric[6]);

}  // namespace krot::internal
