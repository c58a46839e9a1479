#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "krot/analysis/geometry_statistics.h"
#include "krot/analysis/model_statistics.h"
#include "krot/analysis/noise.h"
#include "krot/model.h"
#include "krot/model/contradictions.h"
#include "krot/model/pose_checks.h"

namespace krot::internal {

// What EstimateNoise says, in figures; of none where nothing can be told.
struct NoiseFigures {
  struct Quantile {
    double share = 0;  // of the tested observations, that w is not above
    double w = 0;
    double gaussian_w = 0;  // the same of Gaussian noise
  };

  std::optional<double> sigma_px;
  std::optional<double> cauchy_scale_px;
  double critical_w = 0;
  int64_t num_tested = 0;
  int64_t num_above = 0;
  // Observations whose error would not show in one direction, or in any.
  int64_t num_half_controlled = 0;
  int64_t num_uncontrolled = 0;
  std::vector<Quantile> quantiles;
  std::vector<int64_t> num_above_by_image;  // as Model::images
};

// What a model's errors, tracks and depths look like: `krot model_analyzer`.
struct ModelReport {
  ColmapStatistics colmap;
  Contradictions contradictions;  // of the model as its files have it
  PoseChecks poses;
  PixelErrorStatistics pixel_error;  // true errors of all observations
  std::vector<ImageErrors> images;
  std::vector<CameraErrors> cameras;
  std::vector<WorstObservation> worst;
  NoiseFigures noise;
  std::map<int64_t, int64_t> track_lengths;  // length -> points
  // Tracks that hold two or more observations of one image.
  int64_t num_tracks_with_repeated_image = 0;
  DepthStatistics depth;
  TriangulationAngleStatistics triangulation_angle;
};

// Requires a valid model (ValidateModel) and num_worst >= 0.
// O(sum of squared track lengths).
ModelReport AnalyzeModel(const Model& model, int num_worst,
                         int num_threads = -1);

// For the terminal: COLMAP's figures under COLMAP's names, then KROT's. Cameras
// and images are the `max_rows` with the largest errors.
std::string ModelTable(const ModelReport& report, int max_rows);

// One line per camera, then per image, behind a line of names (docs/cli.md).
std::string ModelCsv(const ModelReport& report);

// The same as JSON, with all images; the keys are listed in docs/cli.md.
std::string ModelJson(const ModelReport& report, const std::string& version);

}  // namespace krot::internal
