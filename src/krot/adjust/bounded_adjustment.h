#pragma once

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/context.h"

namespace krot::internal {

// Minimises the squared errors below the cap blocks->cap2, by following the
// minima of barrier problems. All errors of the start must be below the cap;
// those of every iterate are. Sets termination, num_iterations, stationarity,
// duality_gap, num_active and linear_solver of the summary.
void AdjustBelowCap(const BundleAdjustmentOptions& options,
                    const Context& context, const AdjustmentColumns& columns,
                    AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary);

// Moves nearly to a local minimum of the largest error. The cap is one more
// unknown for that, with a weight beside which the squared errors hardly count.
// Counts iterations in the summary and sets its lowest_max_error, which is that
// of the start if it cannot be lowered, and blocks->cap2, 5e-4 above that. In
// the end all errors are below this cap.
void LowerMaxError(const BundleAdjustmentOptions& options,
                   const Context& context, const AdjustmentColumns& columns,
                   AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary);

}  // namespace krot::internal
