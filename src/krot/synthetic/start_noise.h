#pragma once

#include "krot/synthetic/geometry.h"
#include "krot/synthetic/random.h"
#include "krot/synthetic/scene.h"
#include "krot/synthetic/structure.h"

namespace krot::internal {

// A copy of `truth` with the rotations, frame centres and points that
// `options` perturb. All depths stay positive: with d the smallest depth in
// which a frame sees a point (after its rotation), or a point is seen, frame
// and point each move by 0.45 d at most, so that a tenth of every depth is
// left. O(sightings).
SceneGeometry PerturbStart(const SceneGeometry& truth,
                           const Structure& structure,
                           const SceneOptions& options, Random* random);

}  // namespace krot::internal
