#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"
#include "krot/model/fixed_parts.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {

// qw qx qy qz tx ty tz, the quaternion of unit norm.
using PoseBlock = std::array<double, 7>;

PoseBlock ToBlock(const Pose& pose);
Pose ToPose(const PoseBlock& block);
Eigen::Matrix3d RotationOf(const PoseBlock& block);
Eigen::Map<const Eigen::Vector3d> TranslationOf(const PoseBlock& block);

// One observation: the blocks that its reprojection error depends on, and the
// measured pixel.
struct AdjustmentObservation {
  int32_t frame = -1;   // in AdjustmentBlocks::frames
  int32_t sensor = -1;  // in sensors; -1: the rig's reference sensor
  int32_t camera = -1;  // in cameras
  int32_t point = -1;   // in points
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  uint64_t element = 0;  // in Model::track_elements
};

// The unknowns of bundle adjustment as flat blocks of doubles, in the order of
// the model's own records, and the observations that take part.
struct AdjustmentBlocks {
  std::vector<PoseBlock> frames;   // rig_from_world
  std::vector<PoseBlock> sensors;  // sensor_from_rig, rig by rig
  std::vector<std::vector<double>> cameras;
  std::vector<int> camera_models;  // their ids
  std::vector<Eigen::Vector3d> points;
  // The square of the cap on every error in a bounded adjustment, pixels^2. It
  // is an unknown where the cap is lowered.
  double cap2 = std::numeric_limits<double>::infinity();
  std::vector<AdjustmentObservation> observations;  // point by point
  // Marks the blocks that must not move.
  std::vector<char> frame_is_fixed;
  std::vector<char> sensor_is_fixed;  // if a fixed frame sees through it
  std::vector<char> point_is_fixed;

  int64_t num_images = 0;  // with observations
  int64_t num_no_pose = 0;
  int64_t num_behind = 0;
  int64_t num_short_track = 0;
};

// Leaves out observations without a pose, behind their camera or without a
// finite projection, and then all observations of points that have fewer than
// `min_track_length` left and are not fixed. Throws ModelError if a camera
// without an image plane sees a point. O(observations).
AdjustmentBlocks MakeAdjustmentBlocks(const Model& model, int min_track_length,
                                      const FixedParts& fixed = {});

// A copy of the model with the values of the blocks. Records whose blocks did
// not change since `before` keep their bits; the poses of images follow their
// frames.
Model ApplyBlocks(const Model& model, const AdjustmentBlocks& before,
                  const AdjustmentBlocks& after);

}  // namespace krot::internal
