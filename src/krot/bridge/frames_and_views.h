#pragma once

#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/model/fixed_parts.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {

// Numbers the frames that have observations, and their images as views, of a
// problem whose observations name their image as `view`; they name the view
// from now on.
void AddFramesAndViews(const Model& model,
                       const std::vector<ImageGeometry>& geometries,
                       Ranks* ranks, BuiltProblem* built);

// Fixes what is marked of the model where the problem starts.
void FixPositions(const FixedParts& fixed, BuiltProblem* built);

}  // namespace krot::internal
