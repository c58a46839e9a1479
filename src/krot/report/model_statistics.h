#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/analysis/pixel_errors.h"
#include "krot/model/model.h"

namespace krot {

// What a model's errors, tracks and depths look like: `krot model_analyzer`.

struct Distribution {
  int64_t count = 0;  // the rest is 0 if this is
  double min = 0;
  double median = 0;  // nearest rank
  double mean = 0;
  double max = 0;
};

// The true pixel errors of one image's or one camera's observations.
struct ErrorGroup {
  uint32_t id = 0;
  std::string name;  // the image's name, the camera's model
  PixelErrorStatistics error;
};

struct WorstObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double error_px = 0;
};

struct ModelStatistics {
  int64_t num_cameras = 0;
  int64_t num_rigs = 0;  // 0 in a model without rigs, as num_frames
  int64_t num_frames = 0;
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  double mean_track_length = 0;
  double mean_observations_per_image = 0;
  // Over the points that store an error: COLMAP's mean reprojection error.
  double mean_stored_error = 0;

  PixelErrorStatistics pixel_error;
  std::vector<ErrorGroup> images;       // in the model's order
  std::vector<ErrorGroup> cameras;      // in the model's order
  std::vector<WorstObservation> worst;  // descending error

  Distribution track_length;
  // Tracks that hold two or more observations of one image.
  int64_t num_tracks_with_repeated_image = 0;
  // Depths of the observations, scene units; finite ones only.
  Distribution depth;
  int64_t num_behind = 0;  // depth <= 0
};

// Requires a valid model (ValidateModel) and num_worst >= 0. O(n log n) in
// the number of observations.
ModelStatistics AnalyzeModel(const Model& model, int num_worst,
                             int num_threads = -1);

}  // namespace krot
