#pragma once

#include <array>
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

// A camera that COLMAP's mapper discards with its images, as a focal length is
// below 0.1 or above 10 of the image's larger side (Mapper's
// min_focal_length_ratio and max_focal_length_ratio).
struct DiscardedCamera {
  CameraId camera_id = 0;
  double focal_length_px = 0;
  uint64_t side_px = 0;
};
// Of the cameras that images with observations have.
std::vector<DiscardedCamera> FindDiscardedCameras(const Model& model);

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

// ---- Colours, for COLMAP's GUI ----

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
