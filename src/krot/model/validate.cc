#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// A model and indices of its ids.
struct IndexedModel {
  explicit IndexedModel(const Model& model)
      : records(model),
        cameras(model.cameras),
        rigs(model.rigs),
        frames(model.frames),
        images(model.images),
        points3D(model.points3D) {}

  const Model& records;
  IdIndex<CameraId> cameras;
  IdIndex<RigId> rigs;
  IdIndex<FrameId> frames;
  IdIndex<ImageId> images;
  IdIndex<Point3DId> points3D;
};

// Joins the parts into a message and throws it as a ModelError.
template <typename... Parts>
[[noreturn]] void Fail(const Parts&... parts) {
  std::ostringstream message;
  message.precision(17);
  (message << ... << parts);
  throw ModelError(message.str());
}

// Sums of squared errors of pixels would not be finite.
constexpr double kTooLarge = 1e100;

// Fails unless the value is finite and below the limit; `owner()` names the
// record that it belongs to.
template <typename Owner>
void CheckFinite(double value, const Owner& owner, const char* quantity,
                 double limit = kInfinity) {
  if (std::abs(value) < limit) return;
  Fail(owner(), ": found ", quantity, " ", value, ", expected a finite number",
       limit == kInfinity ? "" : " below 1e100");
}

// Advice at the end of messages about inconsistent rigs and frames.
constexpr const char* kUsePosesOfImages =
    "remove both rigs and frames: then the poses in images count";

std::string DescribeSensor(const SensorId& sensor_id) {
  const auto name = SensorTypeName(sensor_id.type);
  return (name ? std::string(*name)
               : "type " + std::to_string(sensor_id.type)) +
         " " + std::to_string(sensor_id.id);
}

void CheckSensorExists(const Rig& rig, const SensorId& sensor_id,
                       const IdIndex<CameraId>& cameras) {
  if (!SensorTypeName(sensor_id.type)) {
    Fail("rig ", rig.id, ": found the sensor ", DescribeSensor(sensor_id),
         ", expected type -1 (none), 0 (camera) or 1 (IMU)");
  }
  if (sensor_id.type == kSensorTypeCamera && !cameras.Find(sensor_id.id)) {
    Fail("rig ", rig.id, ": found camera ", sensor_id.id,
         " as a sensor, expected one that exists in cameras");
  }
}

void CheckSensorsDiffer(const Rig& rig,
                        const std::vector<SensorId>& sensor_ids) {
  for (size_t i = 0; i < sensor_ids.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (!(sensor_ids[i] == sensor_ids[j])) continue;
      Fail("rig ", rig.id, ": found the sensor ", DescribeSensor(sensor_ids[i]),
           " twice, expected different sensors");
    }
  }
}

void CheckRig(const Rig& rig, const IdIndex<CameraId>& cameras) {
  const auto owner = [&] { return "rig " + std::to_string(rig.id); };
  if (!rig.ref_sensor_id && !rig.sensors.empty()) {
    Fail(owner(), ": found ", rig.sensors.size(),
         " sensors and no reference sensor, expected one");
  }
  std::vector<SensorId> sensor_ids;
  if (rig.ref_sensor_id) sensor_ids.push_back(*rig.ref_sensor_id);
  for (const RigSensor& sensor : rig.sensors) {
    sensor_ids.push_back(sensor.sensor_id);
    if (!sensor.sensor_from_rig) continue;
    const Pose& pose = *sensor.sensor_from_rig;
    if (!HasRotation(pose.quaternion_wxyz)) {
      Fail(owner(), ": found the quaternion ", pose.quaternion_wxyz[0], " ",
           pose.quaternion_wxyz[1], " ", pose.quaternion_wxyz[2], " ",
           pose.quaternion_wxyz[3],
           " of a sensor, expected one that can be "
           "normalised");
    }
    for (const double value : sensor.sensor_from_rig->translation) {
      CheckFinite(value, owner, "a sensor's translation");
    }
  }
  for (const SensorId& sensor_id : sensor_ids) {
    CheckSensorExists(rig, sensor_id, cameras);
  }
  CheckSensorsDiffer(rig, sensor_ids);
}

// The index of the image that this data of the frame refers to.
int32_t ResolveImage(const IndexedModel& model, const Frame& frame,
                     const FrameData& data) {
  if (data.sensor_id.type != kSensorTypeCamera) {
    Fail("frame ", frame.id, ": found data of the sensor ",
         DescribeSensor(data.sensor_id), ", expected a camera or an IMU");
  }
  std::optional<int32_t> position;
  if (data.data_id <= std::numeric_limits<ImageId>::max()) {
    position = model.images.Find(static_cast<ImageId>(data.data_id));
  }
  if (!position) {
    Fail("frame ", frame.id, ": found image id ", data.data_id,
         ", expected one that exists in images; take it out of frames, or ",
         kUsePosesOfImages);
  }
  const Image& image = model.records.images[*position];
  if (image.camera_id != data.sensor_id.id) {
    Fail("frame ", frame.id, ": found ", Describe(image), " as data of camera ",
         data.sensor_id.id, ", expected its camera ", image.camera_id);
  }
  return *position;
}

void CheckCameraHasPose(const Rig& rig, const Image& image) {
  const std::optional<SensorPlace> place =
      FindSensor(rig, {kSensorTypeCamera, image.camera_id});
  if (!place) {
    Fail(Describe(image), ": found its frame in rig ", rig.id,
         ", expected a rig with its camera ", image.camera_id);
  }
  if (!place->sensor_from_rig) {
    Fail(Describe(image), ": found its camera ", image.camera_id,
         " without a pose in rig ", rig.id,
         ", expected one; calibrate the rig, or ", kUsePosesOfImages);
  }
}

// Checks a frame, and enters it as the frame of each of its images.
void CheckFrame(const IndexedModel& model, const Frame& frame,
                std::vector<const Frame*>* frame_of_image) {
  const std::optional<int32_t> rig = model.rigs.Find(frame.rig_id);
  if (!rig) {
    Fail("frame ", frame.id, ": found rig id ", frame.rig_id,
         ", expected one that exists in rigs");
  }
  for (const FrameData& data : frame.data) {
    if (data.sensor_id.type == kSensorTypeImu) continue;
    const int32_t position = ResolveImage(model, frame, data);
    const Image& image = model.records.images[position];
    CheckCameraHasPose(model.records.rigs[*rig], image);
    const Frame*& known_frame = (*frame_of_image)[position];
    if (known_frame != nullptr) {
      Fail(Describe(image), ": found in frame ", known_frame->id,
           " and again in frame ", frame.id, ", expected once");
    }
    known_frame = &frame;
  }
}

// Checks rigs and frames as ValidateModel promises, but not that their ids are
// unique.
void ValidateRigsAndFrames(const IndexedModel& model) {
  for (const Rig& rig : model.records.rigs) CheckRig(rig, model.cameras);
  const std::vector<Image>& images = model.records.images;
  std::vector<const Frame*> frame_of_image(images.size(), nullptr);
  for (const Frame& frame : model.records.frames) {
    CheckFrame(model, frame, &frame_of_image);
  }
  for (size_t i = 0; i < images.size(); ++i) {
    if (frame_of_image[i] != nullptr) continue;
    Fail(Describe(images[i]),
         ": found in no frame, expected one: the model has rigs and frames");
  }
}

// Advice at the end of messages about track elements whose 2D point does not
// exist.
constexpr const char* kHowToReadTheRest =
    "; --Model.on_contradiction follow_images reads the rest";

void CheckTrackElement(const IndexedModel& model, const Point3D& point,
                       const TrackElement& element) {
  const std::optional<int32_t> position = model.images.Find(element.image_id);
  if (!position) {
    Fail("3D point ", point.id, ": found image id ", element.image_id,
         " in its track, expected one that exists in images",
         kHowToReadTheRest);
  }
  const Image& image = model.records.images[*position];
  if (element.point2D_idx >= image.points2D.size()) {
    Fail("3D point ", point.id, ": found 2D point ", element.point2D_idx,
         " of ", Describe(image), " in its track, but that image has only ",
         image.points2D.size(), " 2D points", kHowToReadTheRest);
  }
  const Point2D& pixel = image.points2D[element.point2D_idx];
  for (const double value : {pixel.x, pixel.y}) {
    if (std::abs(value) < kTooLarge) continue;
    Fail("3D point ", point.id, ": found 2D point ", element.point2D_idx,
         " of ", Describe(image), " in its track, a coordinate of which is ",
         value, ", expected a finite number below 1e100");
  }
}

// Checks that tracks refer to existing 2D points. Requires valid track ranges.
void ValidateObservations(const IndexedModel& model) {
  for (const Point3D& point : model.records.points3D) {
    for (uint64_t i = point.track_begin; i < point.track_end; ++i) {
      CheckTrackElement(model, point, model.records.track_elements[i]);
    }
  }
}

template <typename Id>
void CheckIds(const IdIndex<Id>& index, const char* records) {
  if (index.duplicate()) {
    Fail(records, ": found id ", *index.duplicate(),
         " twice, expected unique ids");
  }
  constexpr Id kInvalid = std::numeric_limits<Id>::max();
  if (index.Find(kInvalid)) {
    Fail(records, ": found id ", kInvalid,
         ", which in COLMAP stands for none, expected another; renumber it");
  }
}

void CheckCamera(const Camera& camera) {
  const auto owner = [&] { return "camera " + std::to_string(camera.id); };
  const CameraModelInfo* info = FindCameraModel(camera.model_id);
  if (info == nullptr) {
    Fail(owner(), ": found camera model id ", camera.model_id,
         ", expected 0 to ", CameraModels().back().id);
  }
  if (camera.params.size() != static_cast<size_t>(info->num_params)) {
    Fail(owner(), ": found ", camera.params.size(), " parameters, expected ",
         info->num_params, " for ", info->name, " (", info->param_names, ")");
  }
  for (const double param : camera.params) {
    CheckFinite(param, owner, "the parameter", kTooLarge);
  }
}

// With a focal length of zero, or a panorama of no width or height, all rays
// project to one pixel.
void CheckFocalLength(const Camera& camera) {
  const CameraModelInfo& info = *FindCameraModel(camera.model_id);
  const bool has_two = !info.has_image_plane || info.num_focal_lengths() == 2;
  if (camera.params[0] != 0 && (!has_two || camera.params[1] != 0)) return;
  Fail("camera ", camera.id, ": found 0 for ",
       info.param_names.substr(0, info.param_names.find(", c")), " of ",
       info.name, ", expected what its photos have, in pixels");
}

void CheckImage(const Image& image, const IndexedModel& model) {
  if (image.name.find('\0') != std::string::npos) {
    Fail("image ", image.id, ": found a zero byte in its name, expected none");
  }
  const std::optional<int32_t> camera = model.cameras.Find(image.camera_id);
  if (!camera) {
    Fail(Describe(image), ": found camera id ", image.camera_id,
         ", expected one that exists in cameras");
  }
  CheckFocalLength(model.records.cameras[*camera]);
}

void CheckPoint3D(const Point3D& point) {
  const auto owner = [&] { return "3D point " + std::to_string(point.id); };
  for (const double value : point.xyz) {
    CheckFinite(value, owner, "a coordinate");
  }
}

void CheckTracksAreConsecutive(const Model& model) {
  uint64_t end = 0;
  for (const Point3D& point : model.points3D) {
    if (point.track_begin != end || point.track_end < end) {
      Fail("3D point ", point.id, ": found the track [", point.track_begin,
           ", ", point.track_end, "), expected one that begins at ", end);
    }
    end = point.track_end;
  }
  if (end == model.track_elements.size()) return;
  Fail("found ", model.track_elements.size(),
       " track elements, expected the tracks' total of ", end);
}

}  // namespace
}  // namespace krot::internal

namespace krot {

using namespace internal;

void ValidateModel(const Model& model) {
  const IndexedModel indexed(model);
  CheckIds(indexed.cameras, "cameras");
  CheckIds(indexed.images, "images");
  CheckIds(indexed.rigs, "rigs");
  CheckIds(indexed.frames, "frames");
  CheckIds(indexed.points3D, "points3D");
  for (const Camera& camera : model.cameras) CheckCamera(camera);
  for (const Image& image : model.images) CheckImage(image, indexed);
  ValidateRigsAndFrames(indexed);
  for (const Point3D& point : model.points3D) CheckPoint3D(point);
  CheckTracksAreConsecutive(model);
  ValidateObservations(indexed);
}

}  // namespace krot
