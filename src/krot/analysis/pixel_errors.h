#pragma once

#include <cstdint>
#include <vector>

#include "krot/math/norm.h"
#include "krot/model/model.h"

namespace krot {

// True reprojection errors of a model: through the full camera, in pixels of
// the norm, in the order of Model::track_elements. NaN where a point is not in
// front of its camera, has no pose, or projects to no finite pixel (no camera
// without an image plane gives one). Poses are those of ImageGeometries: in a
// model with rigs the frames'. Requires a valid model (ValidateModel).
// O(observations).
std::vector<double> PixelErrors(const Model& model, int num_threads = -1,
                                Norm norm = Norm::L2());

// Over the finite errors.
struct PixelErrorStatistics {
  double max = 0;
  double p99 = 0;  // nearest rank: the least that 99 % do not exceed
  double mean = 0;
  double rms = 0;
  int64_t count = 0;       // finite errors
  int64_t not_finite = 0;  // behind, without pose, or not projectable
};
// All zero if there are none. O(count).
PixelErrorStatistics Summarize(const std::vector<double>& errors_px);

// Sets every point's stored error to the mean of its finite errors (-1 if it
// has none): what COLMAP's model_analyzer averages and its GUI colours by.
// `errors_px` as PixelErrors gives them; throws std::invalid_argument if
// their number is not that of the track elements.
void UpdatePointErrors(const std::vector<double>& errors_px, Model* model);

}  // namespace krot
