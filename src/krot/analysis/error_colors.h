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
// that COLMAP's GUI shows several models on one scale (its own colours by error
// are relative to each model's). `errors_px` as PixelErrors gives them; throws
// std::invalid_argument if their number is not that of the track elements or
// top_px is not a positive number. O(observations).
void ColorPointsByError(const std::vector<double>& errors_px, double top_px,
                        Model* model);

}  // namespace krot::internal
