#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/geometry/transform.h"

namespace krot {

// A COLMAP sparse model as plain data, every record in the order of its file
// and every number with the bits it was stored with.
//
// Identifiers are COLMAP's. Every image belongs to a frame, and every frame to
// a rig, also in a model whose files hold neither ("legacy", COLMAP 3.8
// to 3.11): there they are trivial (trivial_rigs.h), and only writing tells.

using CameraId = uint32_t;
using RigId = uint32_t;
using FrameId = uint32_t;
using ImageId = uint32_t;
using Point3DId = uint64_t;

// The id that a 2D point without a 3D point bears (-1 in text files).
inline constexpr Point3DId kInvalidPoint3DId =
    std::numeric_limits<Point3DId>::max();

// A rigid transform x -> R(q) x + t as COLMAP stores it; the quaternion keeps
// its stored norm and sign.
struct Pose {
  QuaternionWxyz quaternion_wxyz = {1, 0, 0, 0};
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  // Of the normalised quaternion.
  Eigen::Matrix3d Rotation() const { return RotationOf(quaternion_wxyz); }
  RigidTransform Transform() const { return {Rotation(), translation}; }
};

inline Pose ToPose(const RigidTransform& transform) {
  return {ToWxyz(Eigen::Quaterniond(transform.rotation)),
          transform.translation};
}

struct Camera {
  CameraId id = 0;
  int model_id = 0;  // see camera/camera_model.h
  uint64_t width = 0;
  uint64_t height = 0;
  std::vector<double> params;
};

inline constexpr int32_t kSensorTypeInvalid = -1;
inline constexpr int32_t kSensorTypeCamera = 0;
inline constexpr int32_t kSensorTypeImu = 1;

struct SensorId {
  int32_t type = kSensorTypeInvalid;
  uint32_t id = 0;  // the camera id if type is kSensorTypeCamera

  bool operator==(const SensorId& other) const {
    return type == other.type && id == other.id;
  }
};

struct RigSensor {
  SensorId sensor_id;
  std::optional<Pose> sensor_from_rig;
};

struct Rig {
  RigId id = 0;
  std::optional<SensorId> ref_sensor_id;  // none if the rig has no sensors
  std::vector<RigSensor> sensors;         // all but the reference sensor
};

struct FrameData {
  SensorId sensor_id;
  uint64_t data_id = 0;  // the image id if the sensor is a camera
};

struct Frame {
  FrameId id = 0;
  RigId rig_id = 0;
  Pose rig_from_world;
  std::vector<FrameData> data;
};

struct Point2D {
  double x = 0;  // pixels; the upper left pixel's centre is (0.5, 0.5)
  double y = 0;
  Point3DId point3D_id = kInvalidPoint3DId;
};

struct Image {
  ImageId id = 0;
  Pose cam_from_world;
  CameraId camera_id = 0;
  std::string name;
  std::vector<Point2D> points2D;
};

struct TrackElement {
  ImageId image_id = 0;
  uint32_t point2D_idx = 0;
};

struct Point3D {
  Point3DId id = 0;
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> color = {0, 0, 0};
  double error = -1;  // mean reprojection error in pixels; -1 = none
  // The track: Model::track_elements[track_begin, track_end).
  uint64_t track_begin = 0;
  uint64_t track_end = 0;
};

struct Model {
  bool stores_rigs = false;  // whether the files hold rigs and frames
  std::vector<Camera> cameras;
  std::vector<Rig> rigs;
  std::vector<Frame> frames;
  std::vector<Image> images;
  std::vector<Point3D> points3D;
  // The tracks of all points, one after another.
  std::vector<TrackElement> track_elements;
};

}  // namespace krot
