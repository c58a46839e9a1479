#pragma once

#include "krot/model.h"

namespace krot::internal {

// A camera of the given COLMAP model with its principal point in the middle
// of the image and a moderate distortion: fy = 1.01 fx where the model has
// both, and the projection is one to one over the whole image for
// focal_length >= half the larger side. A panorama (EQUIRECTANGULAR) fills its
// image, whatever the focal length. Throws std::invalid_argument for an unknown
// id. Lengths in pixels.
Camera DefaultCamera(int model_id, uint64_t width, uint64_t height,
                     double focal_length);

}  // namespace krot::internal
