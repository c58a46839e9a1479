#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "krot/analysis/alignment.h"
#include "krot/analysis/model_correspondence.h"
#include "krot/analysis/pixel_errors.h"
#include "krot/model/model.h"

namespace krot {

// How two models of the same images differ. Lengths are in the scene units of
// the first, into whose coordinates the second has been brought.

// What one model holds.
struct ModelCounts {
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
};

// Zero if there are none.
struct DifferenceStatistics {
  double max = 0;
  double median = 0;  // the lower one of two
  double mean = 0;
  double rms = 0;
  int64_t count = 0;
};

// How far an image moved.
struct PoseDifference {
  double rotation_deg = 0;  // angle between the two rotations
  double center = 0;        // distance of the two projection centres
};

struct ImageDifference {
  ImageId image_id1 = 0;
  ImageId image_id2 = 0;
  std::string image_name;
  std::optional<PoseDifference> pose;  // none if either has no pose
  PixelErrorStatistics errors1;        // of all its observations
  PixelErrorStatistics errors2;
};

struct PointDifference {
  Point3DId point3D_id1 = 0;
  Point3DId point3D_id2 = 0;
  double distance = 0;
};

struct ComparisonSummary {
  ModelCounts model1;
  ModelCounts model2;
  ModelCounts shared;
  int64_t num_shared_poses = 0;  // shared images with a pose in both

  AlignmentKind alignment = AlignmentKind::kNone;
  Similarity world1_from_world2;
  // Of the centroid of the second model's cameras, by the alignment: unlike its
  // translation it does not grow with the distance from the origin.
  double moved = 0;
  double scene_radius = 0;  // SceneRadius of the shared poses that are held

  DifferenceStatistics rotation_deg;
  DifferenceStatistics center;
  DifferenceStatistics point;

  PixelErrorStatistics errors1;         // of all its observations
  PixelErrorStatistics errors2;         // of all its observations
  PixelErrorStatistics shared_errors1;  // of the shared ones
  PixelErrorStatistics shared_errors2;

  std::vector<ImageDifference> images;  // the shared ones
  // The num_worst points that moved farthest, descending; equal ones in the
  // order of the first model.
  std::vector<PointDifference> worst_points;
};

// The poses of the shared images that have one in both models, in their order.
std::vector<PosePair> SharedPoses(const Model& model1, const Model& model2,
                                  const ModelCorrespondence& correspondence);

struct CompareModelsOptions {
  AlignmentKind alignment = AlignmentKind::kFrame;
  int num_worst = 10;  // points to list; >= 0
  int num_threads = -1;
};

// None if the models share no poses that `options.alignment` could be found
// from (see Align). Requires valid models (ValidateModel) and the
// correspondence of just these. The result is the same at any thread count.
// O(observations).
std::optional<ComparisonSummary> CompareModels(
    const Model& model1, const Model& model2,
    const ModelCorrespondence& correspondence,
    const CompareModelsOptions& options);

}  // namespace krot
