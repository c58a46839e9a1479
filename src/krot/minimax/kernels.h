#pragma once

#include <algorithm>
#include <cstdint>

namespace krot::internal {

// Constants that descents of one problem (newton_descent.h) and of problems
// side by side have in common.

// Residuals below this count as zero, pixels.
inline constexpr double kZeroPixels = 1e-10;

// kappa weighs the term that shortens steps. With a small kappa steps are
// Newton's, with a large one they are safe. These values need the fewest steps
// on random triangulations: the first of 1e-3, 1e-2, 3e-2, the smallest of
// 1e-6, 1e-5 (docs/history/journal.md, "One triangulation"). Rounding in the
// model is about 1e-16 / kappa.
inline constexpr double kFirstKappa = 1e-2;
inline constexpr double kLargestKappa = 1e9;
// A descent to a coarse tolerance does not need a kappa far below it, and takes
// fewer steps without (docs/history/journal.md, "Res-Int, the first ten
// sweeps").
inline double SmallestKappa(double tolerance) {
  return std::max(1e-5, 0.1 * tolerance);
}
// Factors of kappa after a good trial and after a failed one.
inline constexpr double kKappaFall = 0.01;
inline constexpr double kKappaRise = 10;

// A model promises that a step lowers the cost by some amount. A trial that
// keeps more than the first share of this promise is accepted; one that keeps
// more than the second is good. Accepting less would make next to no progress.
inline constexpr double kSufficientShare = 0.1;
inline constexpr double kGoodShare = 0.5;
// A promise below this, relative to the cost, counts as rounding if the trial
// does not keep it. Otherwise points seen by two cameras would be tried again
// and again (docs/history/journal.md, "One triangulation", step 4).
inline constexpr double kPromiseRounding = 1e-10;
// The smallest tolerance of a descent (DescentGoal).
inline constexpr double kFinestTolerance = 1e-11;

// After a failed trial the model is improved (a lesson) and tried again. After
// kMaxLessons of them kappa rises instead, and also if the cost of a failed
// trial is not below kLessonWorth of that of the failed trial before. Without
// these limits, frames whose residuals all point the same way would not move
// (tests/minimax/degenerate_test.cc).
inline constexpr int kMaxLessons = 5;
inline constexpr double kLessonWorth = 0.99;

// If the weights of all residuals sum to less than this, they are rounding.
inline constexpr double kSmallestWeight = 1e-9;
// A multiplier has grown much if it exceeds kMuchGrowth times its last value
// plus kLeastGrowth.
inline constexpr double kMuchGrowth = 2;
inline constexpr double kLeastGrowth = 1e-3;
// A step is not shortened if depths fall by less than kSmallFall, relative, as
// shorter steps cost iterations. No depth falls by more than kLargestFall.
inline constexpr double kSmallFall = 0.1;
inline constexpr double kLargestFall = 0.9;
// Smallest pivot of H, relative to its trace: it keeps H invertible despite
// rounding.
inline constexpr double kPivotRounding = 1e-14;
// The metric G is kept as long as the squared relative change of residuals and
// depths since it was set is below this. If it were kept longer, optima at
// infinity would be missed (docs/history/journal.md, "Res-Int, the first ten
// sweeps").
inline constexpr double kMetricReach = 1e-2;
// If depths grow by less than this factor, the minimiser is not far away.
inline constexpr double kNearby = 1e3;

// Plain memory, no Eigen: this header is shared with code compiled for other
// vector units.

// Residuals, or problems, side by side.
inline constexpr int kLanes = 8;
using LaneDoubles = double[kLanes];

// A row of a residual [Zhang18, (2), (3)]: a_1, b_1, a_2, b_2, c, d.
inline constexpr int kResidualRow = 12;

// Eight residuals side by side, one of them per lane.
struct alignas(64) ResidualBlock {
  double row[kResidualRow][kLanes];
};

// Eight residuals side by side, differentiated.
struct alignas(64) GradientBlock {
  double value[kLanes];
  double gradient[3][kLanes];
  double depth[kLanes];
  // The Hessian for the depth held fixed is curvature * bend * bend'.
  double curvature[kLanes];
  double bend[3][kLanes];
};

// The functions that residual_kernel.cc defines for one kind of vector units.
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
  // The largest share of the step d, at most 1, on which no depth falls by more
  // than kLargestFall of what it is at x; all must be positive.
  double (*depth_share)(const ResidualBlock* blocks, int64_t num_blocks,
                        const double x[3], const double d[3]);
  // The upper triangle, row by row, of
  //   sum_i (A_i'A_i + cost^2 c_i c_i') / w_i^2
  // over all lanes of `num_blocks` blocks; all depths must be positive.
  void (*sum_metric)(const ResidualBlock* blocks, int64_t num_blocks,
                     const double x[3], double cost, double metric[6]);
};
extern const ResidualKernels& best_residual_kernels;

// Problems (1) side by side, one per lane of a vector.

// A row of a residual of every lane's problem, as in ResidualBlock. A problem
// that has fewer residuals than the others has 0 / 1 here.
struct alignas(64) LaneRow {
  LaneDoubles entry[kResidualRow];
};

// A residual of every lane near x, value + gradient . d. Every iteration writes
// them anew.
struct alignas(64) LanePiece {
  LaneDoubles value;
  LaneDoubles gradient[3];
  LaneDoubles depth_inverse;
  LaneDoubles multiplier;  // mu of newton_descent.h
};

// Indices in place of a residual's, as doubles in lanes: of the zero piece (no
// residual falls below 0), and of no piece.
inline constexpr double kZeroPieceIndex = -1;
inline constexpr double kNoPieceIndex = -2;
// The largest number of active pieces.
inline constexpr int kCorners = 4;

// The status of a lane's problem, a number as lanes hold it.
inline constexpr double kLaneIdle = 0;   // the lane has no problem
inline constexpr double kLaneFresh = 1;  // not evaluated yet
inline constexpr double kLaneRuns = 2;
// The problem has ended, like a NewtonDescent:
inline constexpr double kLaneStationary = 3;
inline constexpr double kLaneZeroCost = 4;
inline constexpr double kLaneLowEnough = 5;
inline constexpr double kLaneBehind = 6;
// Not for lanes: the minimiser is far away, or it takes too many steps.
inline constexpr double kLaneGivesUp = 7;

// DescentGoal (newton_descent.h) and the limit of iterations.
struct LaneGoal {
  double tolerance;
  double level;
  double sufficient;
  int max_iterations;
};

// The descents of all lanes between two steps (SideBySideDescent::Begin).
struct alignas(64) LaneDescents {
  LaneDoubles status;
  LaneDoubles count;  // residuals, >= 1
  LaneDoubles x[3];
  LaneDoubles cost_initial;
  LaneDoubles cost;
  LaneDoubles iterations;  // steps tried

  // The active set: indices of residuals, kZeroPieceIndex or
  // kNoPieceIndex, and their weights.
  LaneDoubles index[kCorners];
  LaneDoubles weight[kCorners];
  // Their multipliers in H of the next step: of residuals only, with sum 1.
  LaneDoubles multiplier[kCorners];

  LaneDoubles is_cold;  // whether the next step only finds multipliers
  LaneDoubles raises;   // whether multipliers may only rise
  LaneDoubles kappa;
  LaneDoubles lessons;
  LaneDoubles cost_failed;
  LaneDoubles calls;
  LaneDoubles depth_start;
  LaneDoubles x_metric[3];
  LaneDoubles metric[6];
};

// The functions that lane_descent.cc defines for one kind of vector units.
struct LaneKernels {
  // Whether lanes are faster than one problem after the other: vectors have
  // four numbers or more.
  bool lanes_pay;
  // One step of NewtonDescent, for p = 2, in every lane that has a problem, or
  // a part of a step if the active set changes often: minimises the model of
  // all residuals and tries the step. A failed trial adds multipliers to the
  // model, but no tangents. A lane ends as NewtonDescent does, or gives up; it
  // does not depend on other lanes. `pieces` is memory for `num_rows` pieces,
  // the same in all steps. About 30 ns per row and step for all lanes together,
  // plus 400 ns.
  void (*step_lanes)(const LaneRow* rows, int num_rows, const LaneGoal& goal,
                     LaneDescents* descents, LanePiece* pieces);
};
extern const LaneKernels& best_lane_kernels;

}  // namespace krot::internal
