#pragma once

#include <ceres/problem.h>
#include <ceres/solver.h>

#include "krot/adjust/barrier_loss.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/adjust/iteration_observer.h"

namespace krot {

// Follows the minima of a problem whose every residual block bears `loss`, as
// the barrier's weight falls, until the duality gap is a small share of the
// cost. Every iterate stays feasible. Fills in what a summary says of the end:
// its termination, stationarity, duality_gap and num_active.
//
// A stage that Ceres ends for any reason but a cancellation is followed by the
// next: the tests at the end judge.
void FollowBarrierPath(const BundleAdjustmentOptions& options,
                       ceres::Solver::Options solver_options, BarrierLoss* loss,
                       IterationObserver* observer, ceres::Problem* problem,
                       BundleAdjustmentSummary* summary);

}  // namespace krot
