#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// What a model's errors look like. Everything here is plain data; printing is
// the tools' business.

// The figures of COLMAP's model_analyzer, computed as COLMAP 3.8 does.
struct ColmapStatistics {
  int64_t num_rigs = 0;  // 0, like num_frames, if the files hold none
  int64_t num_cameras = 0;
  int64_t num_frames = 0;
  int64_t num_images = 0;
  int64_t num_registered_images = 0;  // those with a finite pose
  int64_t num_points = 0;
  int64_t num_observations = 0;  // 2D points that have a 3D point
  double mean_track_length = 0;
  double mean_observations_per_image = 0;  // per registered image
  // The mean of the *stored* point errors, each point once, pixels.
  double mean_reprojection_error = 0;
};
// Requires a valid model. O(observations).
ColmapStatistics ComputeColmapStatistics(const Model& model);

// True errors of one image or camera.
struct ImageErrors {
  ImageId image_id = 0;
  std::string image_name;
  CameraId camera_id = 0;
  PixelErrorStatistics errors;
};
struct CameraErrors {
  CameraId camera_id = 0;
  int64_t num_images = 0;
  PixelErrorStatistics errors;
};

// The errors of every image or camera, as Model::images and Model::cameras,
// also of those without observations. `errors_px` as PixelErrors gives them.
// O(observations).
std::vector<ImageErrors> ErrorsByImage(const Model& model,
                                       const std::vector<double>& errors_px);
std::vector<CameraErrors> ErrorsByCamera(const Model& model,
                                         const std::vector<double>& errors_px);

struct WorstObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double error_px = 0;
};
// The `count` largest finite errors, descending; equal ones in the order of
// the tracks. Requires count >= 0 and errors as above. O(observations).
std::vector<WorstObservation> WorstObservations(
    const Model& model, const std::vector<double>& errors_px, int count);

// How well a model's tracks hold its points.

// Track length -> number of points that have it.
std::map<int64_t, int64_t> TrackLengthHistogram(const Model& model);

// The focal length of a camera that a single image uses, and the median of such
// cameras of the same kind and size, pixels.
struct OddFocalLength {
  double own = 0;
  double others = 0;
};
// Per image: given if its focal length stands out among at least five such
// cameras, by a tenth and by three times the median deviation. This happens
// where each image has a camera of its own, though one camera took them all,
// and the focal length was fitted to too little.
std::vector<std::optional<OddFocalLength>> FindOddFocalLengths(
    const Model& model);

// Zeros if there are no values.
struct ValueRange {
  double min = 0;
  double median = 0;  // the lower one of two
  double max = 0;
  int64_t count = 0;
};

// The depths of all observations whose image has a pose, scene units.
struct DepthStatistics : ValueRange {
  int64_t not_positive = 0;  // points in or behind the plane of their camera
};
// Requires a valid model. O(observations).
DepthStatistics ComputeDepthStatistics(const Model& model);

// Per point the largest angle between two of its rays, from the point to the
// camera centres: how well its depth is determined. Points with fewer than two
// observations by images with a pose have none. Requires a valid model. O(sum
// of squared track lengths).
ValueRange TriangulationAnglesDeg(const Model& model, int num_threads = -1);

}  // namespace krot::internal
