#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "krot/analysis/geometry_statistics.h"
#include "krot/analysis/model_statistics.h"
#include "krot/analysis/pixel_errors.h"
#include "krot/model/contradictions.h"
#include "krot/model/model.h"
#include "krot/model/pose_checks.h"

namespace krot {

// What a model's errors, tracks and depths look like: `krot model_analyzer`.
struct ModelReport {
  ColmapStatistics colmap;
  Contradictions contradictions;  // of the model as its files have it
  PoseChecks poses;
  PixelErrorStatistics pixel_error;  // true errors of all observations
  std::vector<ImageErrors> images;
  std::vector<CameraErrors> cameras;
  std::vector<WorstObservation> worst;
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

}  // namespace krot
