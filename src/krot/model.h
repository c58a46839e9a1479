#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/geometry.h"

namespace krot {

// A COLMAP sparse model as plain data (docs/formats.md), every record in the
// order of its file and every number with the bits it was stored with.
//
// Identifiers are COLMAP's. Every image belongs to a frame, and every frame to
// a rig. This also holds for "legacy" models, whose files have neither (COLMAP
// 3.8 to 3.11): after reading, each of their images has a frame of its own and
// each camera a rig of its own, and they are not written.

using CameraId = uint32_t;
using RigId = uint32_t;
using FrameId = uint32_t;
using ImageId = uint32_t;
using Point3DId = uint64_t;

// The point3D_id of a 2D point without a 3D point (-1 in text files).
inline constexpr Point3DId kInvalidPoint3DId =
    std::numeric_limits<Point3DId>::max();

// A rigid transform x -> R(q) x + t as COLMAP stores it; the quaternion keeps
// its stored norm and sign.
struct Pose {
  QuaternionWxyz quaternion_wxyz = {1, 0, 0, 0};
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  // The rotation of the normalised quaternion.
  Eigen::Matrix3d Rotation() const { return RotationOf(quaternion_wxyz); }
  RigidTransform Transform() const { return {Rotation(), translation}; }
};

inline Pose ToPose(const RigidTransform& transform) {
  return {ToWxyz(Eigen::Quaterniond(transform.rotation)),
          transform.translation};
}

struct Camera {
  CameraId id = 0;
  int model_id = 0;  // COLMAP's number: 0 SIMPLE_PINHOLE, 1 PINHOLE, ...
  uint64_t width = 0;
  uint64_t height = 0;
  std::vector<double> params;  // in COLMAP's order; lengths in pixels
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
  Pose cam_from_world;  // NaN or a quaternion of zeros: not registered
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

// ---- Parts of a model that options refer to ----

// The parts of a model that must not move: one mark per frame and one per 3D
// point, in the order of their records; empty: none is fixed.
struct FixedParts {
  std::vector<char> frames;
  std::vector<char> points3D;

  bool Any() const { return !frames.empty() || !points3D.empty(); }
  bool HasFrame(int32_t f) const { return !frames.empty() && frames[f] != 0; }
  bool HasPoint(int32_t k) const {
    return !points3D.empty() && points3D[k] != 0;
  }
};

// Prior knowledge of where an image was taken or where a 3D point is: the
// projection centre, or the point, lies in `region`, which is in the model's
// frame and unit.
struct KnownPosition {
  enum class Of { kImage, kPoint3D };
  Of of = Of::kImage;
  int32_t index = 0;  // in Model::images or Model::points3D
  Ellipsoid region;
};

// The distance between two cameras, two points, or one of each, and its true
// length if that is known.
struct KnownDistance {
  struct End {
    bool is_image = false;
    int32_t index = 0;  // in Model::images or Model::points3D
  };
  std::array<End, 2> ends;
  std::optional<double> metres;  // > 0
  double tolerance = 0;          // metres; > 0 if `metres` is known
};

// ---- Files ----

enum class ModelFormat { kBinary, kText };

// Finds the format of the model in this folder: binary if all of cameras.bin,
// images.bin and points3D.bin exist, otherwise text if all three .txt files
// exist. Throws ModelError, naming what is missing; if a subfolder "0",
// "sparse/0" or "sparse" holds a model, the message says so.
ModelFormat DetectModelFormat(const std::filesystem::path& folder);

// Reads cameras, rigs, frames (both optional, but only together), images and
// points3D, each file in one read. Every count is checked against the file's
// size before memory is reserved. Throws ModelError. The result is
// syntactically complete; ValidateModel says whether it is consistent. If rigs
// and frames are both empty or missing, the model is a legacy one, as for
// COLMAP, and gets trivial ones.
Model ReadModel(const std::filesystem::path& folder, ModelFormat format);

// DetectModelFormat, ReadModel and ValidateModel in one; most programs need no
// other. Throws ModelError.
Model ReadModel(const std::filesystem::path& folder);

struct WriteModelOptions {
  ModelFormat format = ModelFormat::kBinary;
  // A folder that already holds files with a model's names (any of them, in
  // either format) is replaced only if this is set.
  bool overwrite = false;
  // project.ini is copied from this folder, if there is one.
  std::filesystem::path copy_project_from;  // empty: nothing is copied
  // Receives a sentence about what is left behind in the folder, and why; may
  // be empty.
  std::function<void(const std::string&)> on_note = {};
};

// Throws WriteError if WriteModel would refuse this folder: it holds a model
// and options.overwrite is false; it is a file, a mount point or the working
// directory; or it cannot be created or written to. Changes nothing.
void CheckWritable(const std::filesystem::path& folder,
                   const WriteModelOptions& options);

// Writes the model into a new sibling folder and swaps that in, so that an
// interruption leaves either the old model or the new one. Foreign files in
// `folder` are kept, model files of the other format are not. Rigs and frames
// are written if model.stores_rigs. Throws WriteError; nothing has changed
// then. Requires a valid model (ValidateModel).
void WriteModel(const Model& model, const std::filesystem::path& folder,
                const WriteModelOptions& options = {});

// Checks everything that the rest of KROT relies on:
//  1. ids are unique, and none is the largest of its type, which in COLMAP
//     means "no id";
//  2. camera model ids are known, and cameras have the right number of
//     parameters; no camera with images has a focal length of zero;
//  3. references resolve: image -> camera, rig -> camera, frame -> rig,
//     frame -> image, track -> image and 2D point;
//  4. tracks follow one another in Model::track_elements without gaps;
//  5. with rigs, every image belongs to exactly one frame, as data of its own
//     camera, and that camera has a pose in the frame's rig;
//  6. image names hold no zero byte;
//  7. numbers are finite and quaternions are not zero, with three exceptions:
//     the pose of an image or a frame may be NaN, infinite or have a quaternion
//     of zeros and counts as absent; 2D points in no track, whose coordinates
//     COLMAP's undistorter may write as NaN; and stored point errors, which
//     KROT recomputes.
// Some contradictions are allowed, and it is defined what counts. An image's
// pose may differ from its frame's: the frame's counts, as in COLMAP 4. The 3D
// points that 2D points name may differ from the tracks: the tracks count. A
// track may have any length, 0 included.
//
// Throws ModelError naming the first offender. O(size of the model), a few ns
// per 2D point.
void ValidateModel(const Model& model);

// ---- Errors ----

// The true reprojection errors of a model, through the full camera, in pixels
// of the norm, in the order of Model::track_elements. NaN if a point is not in
// front of its camera, if the image has no pose, or if the point projects to no
// finite pixel (always so for cameras without an image plane). In a model with
// rigs the poses are the frames'. Requires a valid model (ValidateModel).
// O(observations).
std::vector<double> PixelErrors(const Model& model, int num_threads = -1,
                                Norm norm = Norm::L2());

// Over the finite errors.
struct PixelErrorStatistics {
  double max = 0;
  double p99 = 0;  // nearest rank: the smallest error that 99 % do not exceed
  double mean = 0;
  double rms = 0;
  int64_t count = 0;       // finite errors
  int64_t not_finite = 0;  // behind, without pose, or not projectable
};
// All zero if there are none. O(count).
PixelErrorStatistics Summarize(const std::vector<double>& errors_px);

// Sets every point's stored error to the mean of its finite errors (-1 if it
// has none). COLMAP's model_analyzer averages these, and its GUI colours points
// by them. `errors_px` must come from PixelErrors; throws std::invalid_argument
// if there are not as many as track elements.
void UpdatePointErrors(const std::vector<double>& errors_px, Model* model);

}  // namespace krot
