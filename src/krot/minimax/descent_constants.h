#pragma once

#include <algorithm>

namespace krot::internal {

// What the descent of one problem (newton_descent.h) and those of problems
// side by side (lane_descent.h) have in common.

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

}  // namespace krot::internal
