#pragma once

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/model.h"

namespace krot::internal {

// Moves every connected component of `after` by a similarity that gives it the
// centroid of its camera centres, their RMS distance to it, and the mean
// rotation that it has in `before`, all of those cameras that keep their place
// among the others (krot/geometry/consensus.h). Errors change only by rounding.
// The scale stays if a constant sensor_from_rig with a translation fixes it,
// and the rotation if rotations are constant. Nothing is done if frames or
// points are constant, or to a component with anything fixed. O(observations).
void RestoreSimilarity(const BundleAdjustmentOptions& options,
                       const AdjustmentBlocks& before, AdjustmentBlocks* after);

}  // namespace krot::internal
