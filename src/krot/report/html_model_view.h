#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"

namespace krot::internal {

// What the report page draws of a model.

// So many that they take less than 10 MB of a page that holds two models.
inline constexpr int64_t kMaxShownPoints = 100'000;

// As JSON:
//
//   num_points, num_observations   of the model
//   origin     as given
//   images     per image: image_id, name, camera_id, camera_model, center and
//              world_from_cam (row by row; both null without a pose),
//              half_extent (of the image on the plane z = 1) and pixel_error
//              {count, max, p99, mean, rms; the last four null if none}
//   points     num, and per point, in base64 of little-endian arrays: ids
//              (uint64), xyz (float32, relative to `origin`), rgb (uint8),
//              max_error and mean_error (float32, NaN if none), track_length
//              (uint32)
//   histogram  counts of the errors in bins of equal ratio, bins_per_decade of
//              them, the first beginning at 10^min_exponent and holding what
//              is smaller, too
//   tail       [rank, error] at ranks spaced by at most 5 %, the largest error
//              being of rank 1
//
// Beyond `max_points` (>= 1) points are left out of `points` by SelectPoints.
// Requires a valid model. O(observations log observations).
std::string ModelViewJson(const Model& model, const Eigen::Vector3d& origin,
                          int64_t max_points = kMaxShownPoints,
                          int num_threads = -1);

// Indices, ascending, of at most `max_count` of the points: all if they are
// no more; else the max_count / 100 with the largest errors (NaN being least)
// and others at equal steps. Requires max_count >= 1.
// O(points log points).
std::vector<int64_t> SelectPoints(const std::vector<float>& max_errors,
                                  int64_t max_count);

// The mean of the finite points, so that float32 can hold what is relative to
// it; zero if there are none. O(points).
Eigen::Vector3d SceneOrigin(const Model& model);

}  // namespace krot::internal
