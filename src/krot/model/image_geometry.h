#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

#include "krot/model/model.h"

namespace krot {

// Where the image stands: x_cam = R_sr (R_rw x_world + t_rw) + t_sr.
//
// In a model with rigs the frame's pose and the rig's calibration decide, as
// in COLMAP since 3.12, and the pose in the images file is ignored; in a
// legacy model every image is its own frame, with R_sr = I and t_sr = 0.
struct ImageGeometry {
  int32_t camera = -1;  // index in Model::cameras
  // Index in Model::frames (in Model::images if !has_rigs); -1: the image
  // belongs to no frame, or its sensor's place in the rig is unknown.
  int32_t frame = -1;
  // False if frame is -1 or any translation below is not finite.
  bool has_pose = false;
  Eigen::Matrix3d rig_from_world_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d rig_from_world_translation = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cam_from_rig_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d cam_from_rig_translation = Eigen::Vector3d::Zero();
  // The two composed.
  Eigen::Matrix3d cam_from_world_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d cam_from_world_translation = Eigen::Vector3d::Zero();
};

// One per image, in the order of Model::images. Requires a valid model
// (ValidateModel). O(images + frames).
std::vector<ImageGeometry> ImageGeometries(const Model& model);

// Index in Model::images by id.
std::unordered_map<ImageId, int32_t> ImageIndices(const Model& model);

}  // namespace krot
