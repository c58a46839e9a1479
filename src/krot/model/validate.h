#pragma once

#include "krot/model/model.h"

namespace krot {

// Checks everything that the rest of KROT relies on: ids are unique, every
// reference (image -> camera, track -> image and 2D point, 2D point -> 3D
// point, rig -> camera, frame -> rig, frame -> image) resolves and agrees in
// both directions, camera model ids are known and parameter counts fit,
// coordinates and parameters are finite, rotations have non-zero quaternions,
// every image belongs to at most one frame. Translations may be NaN: they
// count as absent (see the bridge).
//
// Throws ModelError naming the first offender. O(size of the model).
void ValidateModel(const Model& model);

}  // namespace krot
