#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// Where the image stands: x_cam = cam_from_rig * (rig_from_world * x_world).
//
// The frame's pose and the rig's calibration decide, as in COLMAP since 3.12;
// the pose in the images file is ignored.
struct ImageGeometry {
  int32_t camera = -1;  // index in Model::cameras
  // Index in Model::frames; -1: the image belongs to no frame, or its sensor's
  // place in the rig is unknown.
  int32_t frame = -1;
  int32_t rig = -1;     // index in Model::rigs; -1 if frame is
  int32_t sensor = -1;  // index in Rig::sensors; -1: the reference sensor
  // False if frame is -1 or anything below is not finite.
  bool has_pose = false;
  RigidTransform rig_from_world;
  RigidTransform cam_from_rig;
  RigidTransform cam_from_world;  // the two composed
};

// One per image, in the order of Model::images. Requires a valid model
// (ValidateModel). O(images + frames).
std::vector<ImageGeometry> ImageGeometries(const Model& model);

// How a sensor sits in its rig.
struct SensorPlace {
  int32_t index = -1;                   // as ImageGeometry::sensor
  std::optional<Pose> sensor_from_rig;  // none: unknown
};

// None if it is no sensor of the rig. O(sensors).
std::optional<SensorPlace> FindSensor(const Rig& rig,
                                      const SensorId& sensor_id);

// Index in Model::images by id.
std::unordered_map<ImageId, int32_t> ImageIndices(const Model& model);

// The names that text files give to the sensor types -1, 0 and 1: INVALID,
// CAMERA, IMU. None for other types and names.
std::optional<std::string_view> SensorTypeName(int32_t type);
std::optional<int32_t> SensorTypeFromName(std::string_view name);

// Puts trivial rigs and frames in place of the model's, as COLMAP does where
// its files hold none: a rig per camera, which is its reference sensor, and a
// frame per image, in the image's pose to the bit; in the order and under the
// ids of what they hold.
void UseTrivialRigs(Model* model);

}  // namespace krot::internal
