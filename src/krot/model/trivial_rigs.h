#pragma once

#include "krot/model.h"

namespace krot::internal {

// Puts trivial rigs and frames in place of the model's, as COLMAP does where
// its files hold none: a rig per camera, which is its reference sensor, and a
// frame per image, in the image's pose to the bit; in the order and under the
// ids of what they hold.
void UseTrivialRigs(Model* model);

}  // namespace krot::internal
