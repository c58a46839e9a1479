#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

// Base64 by RFC 4648, with padding. O(size).
std::string Base64(const unsigned char* bytes, size_t size);

// Base64 of the numbers' bytes as they are in memory.
template <typename Number>
std::string Base64(const std::vector<Number>& numbers) {
  return Base64(reinterpret_cast<const unsigned char*>(numbers.data()),
                numbers.size() * sizeof(Number));
}

// The distribution of a model's errors, small enough for a page whatever the
// number of observations. Only finite errors count.

struct ErrorHistogram {
  // The first bin begins at this power of ten, pixels.
  static constexpr int kMinExponent = -3;
  static constexpr int kBinsPerDecade = 10;
  // Bin k ends at 10^(kMinExponent + (k + 1) / kBinsPerDecade) pixels. The
  // first also holds smaller errors; the last is not empty.
  std::vector<int64_t> counts;
};
// Requires errors >= 0 where finite. O(count).
ErrorHistogram ComputeErrorHistogram(const std::vector<double>& errors_px);

// Pairs (rank, error): the largest error has rank 1, the smallest the last one.
// Ranks increase by at most 5 %, or by 1. O(count log count).
std::vector<std::pair<int64_t, double>> ErrorTail(
    std::vector<double> errors_px);

// ---- What the report page draws of a model ----

// This many points take less than 10 MB of a page that holds two models.
inline constexpr int64_t kMaxShownPoints = 100'000;

// The view of a model as JSON:
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
// If the model has more than `max_points` (>= 1) points, SelectPoints chooses
// those in `points`. Requires a valid model. O(observations log observations).
std::string ModelViewJson(const Model& model, const Eigen::Vector3d& origin,
                          int64_t max_points = kMaxShownPoints,
                          int num_threads = -1);

// What the page draws of the matches. `images` are in the order of the report:
// their width and height on the page, and jpeg, which is null until a photo is
// added. `matches` lists up to 100 matches of each pair (of kept pairs 30),
// evenly chosen from all: x and y in both images, and 1 if the match agrees
// with the poses, otherwise 0. `check` must be CheckPairs' of the model and the
// database. O(matches).
nlohmann::ordered_json PairViewJson(const Model& model,
                                    const Database& database,
                                    const PairCheck& check);

// Indices, ascending, of at most `max_count` of the points: of all, if they are
// no more; otherwise of the max_count / 100 points with the largest errors (NaN
// counts as the smallest) and of others at equal steps. Requires max_count >=
// 1. O(points log points).
std::vector<int64_t> SelectPoints(const std::vector<float>& max_errors,
                                  int64_t max_count);

// The mean of the finite points; coordinates relative to it are small enough
// for float32. Zero if there are none. O(points).
Eigen::Vector3d SceneOrigin(const Model& model);

// The report of a command that made `after` from `before`, or compared the two,
// as one HTML page that refers to nothing outside of it.
//
// `report_json` is what --report_path writes. The page shows its numbers and
// contains it unchanged in the element #krot-report; keys that it lacks are not
// shown. The models are in #krot-models: all images, at most kMaxShownPoints
// points each, and the distribution of all true pixel errors. Byte sequences
// that are not UTF-8 are replaced.
//
// `crops_json` is put into #krot-crops: photos of suspects (SuspectCropsJson),
// or []. `pairs_json` is put into #krot-pairs: the text of PairViewJson, with
// photos if there are any, or null.
//
// Requires valid models (ValidateModel). O(observations log observations); the
// same text at any number of threads.
std::string HtmlPage(const std::string& report_json, const Model& before,
                     const Model& after, int num_threads = -1,
                     const std::string& crops_json = "[]",
                     const std::string& pairs_json = "null");

}  // namespace krot::internal
