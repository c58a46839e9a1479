#pragma once

#include <functional>
#include <memory>

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"

namespace krot {

// Puts something around the projection of an observation, given by its index,
// that has one block more: AdjustmentBlocks::cap2.
using CostOfObservation = std::function<std::unique_ptr<ceres::CostFunction>(
    size_t index, std::unique_ptr<ceres::CostFunction> projection)>;

// Adds every observation of `blocks` to a problem that does not own the loss,
// in their order, and holds still what the options do, and the cap. `cost_of`
// may be empty, `loss` null. The blocks are solved in place and must outlive
// the problem.
void BuildAdjustmentProblem(const BundleAdjustmentOptions& options,
                            const CostOfObservation& cost_of,
                            ceres::LossFunction* loss, AdjustmentBlocks* blocks,
                            ceres::Problem* problem);

// What such a problem does not own.
ceres::Problem::Options AdjustmentProblemOptions();

// Points are eliminated first; the rest is chosen by the number of images.
ceres::Solver::Options AdjustmentSolverOptions(
    const BundleAdjustmentOptions& options, const Context& context,
    AdjustmentBlocks* blocks, const ceres::Problem& problem);

}  // namespace krot
