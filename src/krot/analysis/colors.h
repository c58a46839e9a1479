#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// The colour of an error: from blue at 0 by green and yellow to dark red at
// `top_px` and above, linear between six stops, as on the report page; grey if
// the error is not finite. Requires top_px > 0.
std::array<uint8_t, 3> ErrorColor(double error_px, double top_px);

// Gives every point the colour of the largest finite error of its track, so
// that COLMAP's GUI shows several models on one scale (its own colours are
// relative to each model's errors). `errors_px` as PixelErrors gives them.
// Requires top_px > 0. O(observations).
void ColorPointsByError(const std::vector<double>& errors_px, double top_px,
                        Model* model);

// The colours of the two models in an overlay: blue and vermilion, which
// colour-blind readers can tell apart, too [Okabe and Ito].
inline constexpr std::array<uint8_t, 3> kOverlayColor1 = {0, 114, 178};
inline constexpr std::array<uint8_t, 3> kOverlayColor2 = {213, 94, 0};

// One model that holds both, for COLMAP's GUI to show on top of each other.
// - Image names become "1/name" and "2/name".
// - Ids of the first model stay; those of the second grow by the least power
//   of ten above the largest id of the first, kind by kind.
// - Points bear one colour per model, and the mean true pixel error of their
//   track.
// - If either stores rigs, so does the result, and the pose of an image is
//   then its frame's, as COLMAP since 3.12 reads it.
// Everything else stays, coordinates included: bring them into one frame
// first (TransformModel).
//
// Requires valid models (ValidateModel); the result is one. Throws ModelError
// if an id leaves its type's range. O(size of the models).
Model OverlayModels(const Model& model1, const Model& model2,
                    int num_threads = -1);

}  // namespace krot::internal
