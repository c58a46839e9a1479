#pragma once

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"

namespace krot {

// Adds every observation of `blocks` to a problem that does not own the loss,
// in their order, and holds still what the options do. `loss` may be null. The
// blocks are solved in place and must outlive the problem.
void BuildAdjustmentProblem(const BundleAdjustmentOptions& options,
                            ceres::LossFunction* loss, AdjustmentBlocks* blocks,
                            ceres::Problem* problem);

// What such a problem does not own.
ceres::Problem::Options AdjustmentProblemOptions();

// Points are eliminated first; the rest is chosen by the number of images.
ceres::Solver::Options AdjustmentSolverOptions(
    const BundleAdjustmentOptions& options, const Context& context,
    AdjustmentBlocks* blocks, const ceres::Problem& problem);

}  // namespace krot
