#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// The pose of an image: x_cam = cam_from_rig * (rig_from_world * x_world).
//
// It follows from the frame's pose and the rig's calibration, as in COLMAP
// since 3.12; the pose in the images file is ignored.
struct ImageGeometry {
  int32_t camera = -1;  // index in Model::cameras
  // Index in Model::frames; -1 if the image belongs to no frame, or if its
  // sensor's pose in the rig is unknown.
  int32_t frame = -1;
  int32_t rig = -1;     // index in Model::rigs; -1 if frame is
  int32_t sensor = -1;  // index in Rig::sensors; -1: the reference sensor
  // False if frame is -1 or anything below is not finite.
  bool has_pose = false;
  RigidTransform rig_from_world;
  RigidTransform cam_from_rig;
  RigidTransform cam_from_world;  // the two composed
};

// The geometry of every image, in the order of Model::images. Requires a valid
// model (ValidateModel). O(images + frames).
std::vector<ImageGeometry> ImageGeometries(const Model& model);

// The pose of a sensor in its rig.
struct SensorPlace {
  int32_t index = -1;                   // as ImageGeometry::sensor
  std::optional<Pose> sensor_from_rig;  // none: unknown
};

// Finds a sensor of the rig; none if it does not belong to it. O(sensors).
std::optional<SensorPlace> FindSensor(const Rig& rig,
                                      const SensorId& sensor_id);

// Index in Model::images by id.
std::unordered_map<ImageId, int32_t> ImageIndices(const Model& model);

// The names of the sensor types -1, 0 and 1 in text files: INVALID, CAMERA,
// IMU. None for other types and names.
std::optional<std::string_view> SensorTypeName(int32_t type);
std::optional<int32_t> SensorTypeFromName(std::string_view name);

// Replaces the model's rigs and frames by trivial ones, as COLMAP does if the
// files hold none: a rig for every camera, which is its reference sensor, and a
// frame for every image, whose pose it gets to the bit. Rigs have the order and
// ids of the cameras, frames those of the images.
void UseTrivialRigs(Model* model);

}  // namespace krot::internal
