#pragma once

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/model/model.h"

namespace krot {

// Moves every connected component of `after` by the similarity that gives it
// back what `before` has: the centroid of its camera centres, their RMS
// distance to it, and the mean of its rotations; of those that keep their place
// among the others (krot/geometry/consensus.h). No error changes but by
// rounding. The scale stays where a constant sensor_from_rig with a translation
// fixes it, the rotation where rotations are constant; nothing is done where
// frames or points are, or to a component in which any must not move.
// O(observations).
void RestoreSimilarity(const BundleAdjustmentOptions& options,
                       const AdjustmentBlocks& before, AdjustmentBlocks* after);

}  // namespace krot
