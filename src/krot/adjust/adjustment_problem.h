#pragma once

#include <functional>

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"

namespace krot {

// The loss of an observation by its index; may be or return null.
using LossOfObservation = std::function<ceres::LossFunction*(size_t index)>;

// Adds every observation of `blocks` to a problem that does not own the losses,
// in their order, and holds still what the options do. The blocks are solved in
// place and must outlive the problem.
void BuildAdjustmentProblem(const Model& model,
                            const BundleAdjustmentOptions& options,
                            const LossOfObservation& loss_of,
                            AdjustmentBlocks* blocks, ceres::Problem* problem);

// What such a problem does not own.
ceres::Problem::Options AdjustmentProblemOptions();

// Points are eliminated first; the rest is chosen by the number of images.
ceres::Solver::Options AdjustmentSolverOptions(
    const BundleAdjustmentOptions& options, AdjustmentBlocks* blocks,
    const ceres::Problem& problem);

}  // namespace krot
