#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "krot/model/image_geometry.h"
#include "krot/model/sensor_type.h"
#include "krot/model/validate_parts.h"

namespace krot::internal {
namespace {

// Ends a sentence about rigs and frames that are not worth a repair.
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

// The position of the image that this data of the frame stands for.
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

// Sets the frame of each of this frame's images.
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

}  // namespace

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

}  // namespace krot::internal
