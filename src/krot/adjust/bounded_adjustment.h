#pragma once

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/context.h"

namespace krot {

// Least squares below blocks->cap2, along the minima of the barrier problem,
// from a start whose errors are all below it. Every iterate is, and so is the
// end. Fills in what the summary says of it: termination, num_iterations,
// stationarity, duality_gap, num_active, linear_solver.
void AdjustBelowCap(const BundleAdjustmentOptions& options,
                    const Context& context, const AdjustmentColumns& columns,
                    AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary);

// Moves to a local minimum of the largest error, nearly: with the cap as one
// more unknown, whose weight leaves next to none to the squared errors. Counts
// iterations in the summary and sets its lowest_max_error, the start's if that
// is not lowered, and blocks->cap2, 5e-4 above that. The blocks are below it.
void LowerMaxError(const BundleAdjustmentOptions& options,
                   const Context& context, const AdjustmentColumns& columns,
                   AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary);

}  // namespace krot
