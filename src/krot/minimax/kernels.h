#pragma once

#include <algorithm>
#include <cstdint>

namespace krot::internal {

// What the descent of one problem (newton_descent.h) and those of problems
// side by side have in common.

// Residuals this small are zero, in pixels.
inline constexpr double kZeroPixels = 1e-10;

// kappa. A small one makes steps Newton's, a large one safe; the first and the
// smallest are those with the fewest steps on random triangulations, of 1e-3,
// 1e-2, 3e-2 and of 1e-6, 1e-5 (docs/history/journal.md, "One triangulation").
// Rounding in the model is about 1e-16 / kappa.
inline constexpr double kFirstKappa = 1e-2;
inline constexpr double kSmallestKappa = 1e-5;
inline constexpr double kLargestKappa = 1e9;
// A descent that ends at a tolerance needs none far below it: steps of coarse
// sweeps end sooner (docs/history/journal.md, "Res-Int, the first ten
// sweeps").
inline double SmallestKappa(double tolerance) {
  return std::max(kSmallestKappa, 0.1 * tolerance);
}
// What it is multiplied by after a good trial and after a failed one.
inline constexpr double kKappaFall = 0.01;
inline constexpr double kKappaRise = 10;

// Shares of its promise that a trial keeps: it is taken beyond the first, good
// beyond the second. Taking less would move on by next to nothing.
inline constexpr double kSufficientShare = 0.1;
inline constexpr double kGoodShare = 0.5;
// Promises below this, relative, are rounding if the trial does not keep them:
// at two cameras they were tried again and again (docs/history/journal.md,
// "One triangulation", step 4).
inline constexpr double kPromiseRounding = 1e-10;
// The least tolerance of a descent (DescentGoal).
inline constexpr double kFinestTolerance = 1e-11;

// So often a failed trial may teach the model before kappa rises, and a lesson
// after which the next trial costs no less than this share of the one before
// was none. Without an end to lessons, frames whose residuals all point the
// same way stay where they are (tests/minimax/degenerate_test.cc).
inline constexpr int kMaxLessons = 5;
inline constexpr double kLessonWorth = 0.99;

// Weights that the residuals bear together below this are rounding.
inline constexpr double kSmallestWeight = 1e-9;
// Multipliers have grown much where they exceed (factor, offset) their last.
inline constexpr double kMuchGrowth = 2;
inline constexpr double kLeastGrowth = 1e-3;
// Falls of depths below the first, relative, count as none: steps that are cut
// short cost iterations. No depth falls below the second of what it is.
inline constexpr double kSmallFall = 0.1;
inline constexpr double kSmallestDepthShare = 0.1;
inline constexpr double kLargestFall = 1 - kSmallestDepthShare;
// Keeps H invertible where rounding would not: relative to its trace.
inline constexpr double kPivotRounding = 1e-14;
// G serves as long as (what has changed since, relative)^2 is below this. Kept
// wherever kappa is small, it missed optima at infinity; cold points take 2 %
// longer for this (docs/history/journal.md, "Res-Int, the first ten
// sweeps").
inline constexpr double kMetricReach = 1e-2;
// Up to this growth of depths the minimiser is not far away.
inline constexpr double kNearby = 1e3;

// Plain memory, no Eigen: this header is shared with code compiled for other
// vector units.

inline constexpr int kResidualLanes = 8;

// A row of a residual [Zhang18, (2), (3)]: a_1, b_1, a_2, b_2, c, d.
inline constexpr int kResidualRow = 12;

// Eight residuals side by side, one of them per lane.
struct alignas(64) ResidualBlock {
  double row[kResidualRow][kResidualLanes];
};

// Eight residuals side by side, differentiated.
struct alignas(64) GradientBlock {
  double value[kResidualLanes];
  double gradient[3][kResidualLanes];
  double depth[kResidualLanes];
  // The Hessian for the depth held fixed is curvature * bend * bend'.
  double curvature[kResidualLanes];
  double bend[3][kResidualLanes];
};

// What residual_kernel.cc is compiled to.
struct ResidualKernels {
  // values[i] = r_i(x) for all lanes of `num_blocks` blocks (infinity unless
  // the depth is positive); returns the largest. p >= 1 or infinity. About 1 ns
  // per residual for p = 2.
  double (*evaluate_residuals)(const ResidualBlock* blocks, int64_t num_blocks,
                               double p, const double x[3], double* values);
  // For p = 2, all lanes of `num_blocks` blocks and positive depths: r_i(x) and
  // its derivatives (0 where r_i = 0, which has none).
  void (*evaluate_gradients)(const ResidualBlock* blocks, int64_t num_blocks,
                             const double x[3], GradientBlock* gradients);
  // The largest share of the step d, at most 1, on which no depth falls below
  // `lowest` of what it is at x; all must be positive. 0 <= lowest < 1.
  double (*depth_share)(const ResidualBlock* blocks, int64_t num_blocks,
                        const double x[3], const double d[3], double lowest);
  // The upper triangle, row by row, of
  //   sum_i (A_i'A_i + cost^2 c_i c_i') / w_i^2
  // over all lanes of `num_blocks` blocks; all depths must be positive.
  void (*sum_metric)(const ResidualBlock* blocks, int64_t num_blocks,
                     const double x[3], double cost, double metric[6]);
};
extern const ResidualKernels& best_residual_kernels;

// Problems (1) side by side, one per lane of a vector. Plain memory, no Eigen:
// this header is shared with code compiled for other vector units.

inline constexpr int kLanes = 8;
using LaneDoubles = double[kLanes];

// A row of a residual of every lane's problem: a_1, b_1, a_2, b_2, c, d as in
// ResidualBlock. A problem that has fewer residuals than the others has
// 0 / 1 here.
inline constexpr int kLaneRow = 12;
struct alignas(64) LaneRow {
  LaneDoubles entry[kLaneRow];
};

// The residual near x: value + gradient . d. What every iteration writes anew.
struct alignas(64) LanePiece {
  LaneDoubles value;
  LaneDoubles gradient[3];
  LaneDoubles depth_inverse;
  LaneDoubles multiplier;  // mu of newton_descent.h
};

inline constexpr double kNoPieceIndex = -2;
// As many pieces as can bear a step.
inline constexpr int kCorners = 4;

// What has become of a lane's problem.
inline constexpr double kLaneIdle = 0;   // there is none
inline constexpr double kLaneFresh = 1;  // has not been looked at yet
inline constexpr double kLaneRuns = 2;
// The ends, as those of NewtonDescent:
inline constexpr double kLaneStationary = 3;
inline constexpr double kLaneZeroCost = 4;
inline constexpr double kLaneLowEnough = 5;
inline constexpr double kLaneBehind = 6;
// Not one for lanes: it is far away, or takes too many steps.
inline constexpr double kLaneGivesUp = 7;

// As DescentGoal.
struct LaneGoal {
  double tolerance;
  double level;
  double sufficient;
  int max_iterations;
};

// The descents of all lanes between two steps. A lane begins with `status`
// kLaneFresh, `count`, `x`, the active residuals of a warm start, if there is
// any, and what Begin sets.
struct alignas(64) LaneDescents {
  LaneDoubles status;
  LaneDoubles count;  // residuals, >= 1
  LaneDoubles x[3];
  LaneDoubles cost_initial;
  LaneDoubles cost;
  LaneDoubles iterations;  // steps tried

  // The active set: indices of residuals, of lane_hull.h or kNoPieceIndex, and
  // weights.
  LaneDoubles index[kCorners];
  LaneDoubles weight[kCorners];
  // What they give to H of the next step: over residuals alone, with sum 1.
  LaneDoubles multiplier[kCorners];

  LaneDoubles is_cold;  // whether a first step is for the multipliers alone
  LaneDoubles raises;   // whether multipliers only rise
  LaneDoubles kappa;
  LaneDoubles lessons;
  LaneDoubles cost_failed;
  LaneDoubles calls;
  LaneDoubles depth_start;
  LaneDoubles x_metric[3];
  LaneDoubles metric[6];

  // Prepares a lane whose problem, warm start included, is set.
  void Begin(int lane);
};

// What lane_descent.cc is compiled to.
struct LaneKernels {
  // Whether the vectors are long enough, four numbers or more.
  bool lanes_pay;
  // One step of NewtonDescent, for p = 2, in every lane that has a problem, or
  // part of one where active sets change often: minimises the model of all
  // residuals and tries the step. Failed trials teach the model multipliers,
  // but no tangents. Ends as NewtonDescent does, or gives up. What a lane does
  // depends on its own problem alone. `pieces`: memory for as many as rows, the
  // same in all steps. About 30 ns per row and step, all lanes together, and
  // 400 ns.
  void (*step_lanes)(const LaneRow* rows, int num_rows, const LaneGoal& goal,
                     LaneDescents* descents, LanePiece* pieces);
};
extern const LaneKernels& best_lane_kernels;

}  // namespace krot::internal
