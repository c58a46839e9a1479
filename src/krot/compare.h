#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot {

// How two models of the same images differ. The second is brought into the
// coordinates of the first; lengths are in the scene units of the first.

// How the second model is brought into the coordinates of the first.
enum class AlignmentKind {
  kNone,       // as stored
  kFrame,      // what KROT preserves is made equal: the mean rotation, and the
               // centroid of the camera centres and their RMS distance from it
  kSimilarity  // least squares on the camera centres [Umeyama 1991]
};

// The size of a model.
struct ModelCounts {
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
};

// All zero if there is nothing to compare.
struct DifferenceStatistics {
  double max = 0;
  double median = 0;  // the lower one of the middle two
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
  // How far the alignment moves the centroid of the second model's cameras;
  // unlike its translation, this does not grow with the distance from the
  // origin.
  double moved = 0;
  double scene_radius = 0;  // RMS distance of the shared cameras from their
                            // centroid

  DifferenceStatistics rotation_deg;
  DifferenceStatistics center;
  DifferenceStatistics point;

  PixelErrorStatistics errors1;  // of all observations of the first model
  PixelErrorStatistics errors2;  // of all observations of the second model
  PixelErrorStatistics shared_errors1;  // of the shared observations
  PixelErrorStatistics shared_errors2;

  std::vector<ImageDifference> images;  // the shared ones
  // The num_worst points that moved farthest, descending; equal distances in
  // the order of the first model.
  std::vector<PointDifference> worst_points;
};

struct CompareModelsOptions {
  AlignmentKind alignment = AlignmentKind::kFrame;
  int num_worst = 10;  // points to list; >= 0
  int num_threads = -1;
};

// Finds what the models have in common (images by name, observations by image
// and index, points by the observations they share), brings the second into the
// coordinates of the first, and measures the differences that remain. None if
// they share too few poses for `options.alignment`: kFrame needs one,
// kSimilarity three that are not on a line. Requires valid models
// (ValidateModel). The same at any number of threads. O(observations log
// observations).
std::optional<ComparisonSummary> CompareModels(
    const Model& model1, const Model& model2,
    const CompareModelsOptions& options = {});

// The model in the coordinates that world1_from_world2 maps to: it transforms
// poses of frames and images, baselines of rigs, and points. Pixels do not
// change. What is not finite stays so; the identity keeps all bits. O(size of
// the model).
Model TransformModel(const Model& model, const Similarity& world1_from_world2);

}  // namespace krot
