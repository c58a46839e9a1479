#include "krot/model/image_geometry.h"

#include <optional>

namespace krot {
namespace {

template <typename Id, typename Record>
std::unordered_map<Id, int32_t> IndicesById(
    const std::vector<Record>& records) {
  std::unordered_map<Id, int32_t> indices;
  indices.reserve(records.size());
  for (size_t n = 0; n < records.size(); ++n) {
    indices.emplace(records[n].id, static_cast<int32_t>(n));
  }
  return indices;
}

bool IsSame(const SensorId& a, const SensorId& b) {
  return a.type == b.type && a.id == b.id;
}

// None if the rig does not say where the sensor sits.
std::optional<Pose> SensorFromRig(const Rig& rig, const SensorId& sensor_id) {
  if (rig.ref_sensor_id && IsSame(*rig.ref_sensor_id, sensor_id)) return Pose();
  for (const RigSensor& sensor : rig.sensors) {
    if (IsSame(sensor.sensor_id, sensor_id)) return sensor.sensor_from_rig;
  }
  return std::nullopt;
}

void Place(int32_t frame, const Pose& rig_from_world, const Pose& cam_from_rig,
           ImageGeometry* image) {
  image->frame = frame;
  image->rig_from_world_rotation = rig_from_world.Rotation();
  image->rig_from_world_translation = rig_from_world.translation;
  image->cam_from_rig_rotation = cam_from_rig.Rotation();
  image->cam_from_rig_translation = cam_from_rig.translation;
  image->cam_from_world_rotation =
      image->cam_from_rig_rotation * image->rig_from_world_rotation;
  image->cam_from_world_translation =
      image->cam_from_rig_rotation * image->rig_from_world_translation +
      image->cam_from_rig_translation;
  image->has_pose = image->cam_from_world_translation.allFinite();
}

void PlaceByFrames(const Model& model, std::vector<ImageGeometry>* images) {
  const auto rig_index = IndicesById<RigId>(model.rigs);
  const auto image_index = ImageIndices(model);
  for (size_t f = 0; f < model.frames.size(); ++f) {
    const Frame& frame = model.frames[f];
    const Rig& rig = model.rigs[rig_index.at(frame.rig_id)];
    for (const FrameData& data : frame.data) {
      if (data.sensor_id.type != kSensorTypeCamera) continue;
      const std::optional<Pose> cam_from_rig =
          SensorFromRig(rig, data.sensor_id);
      if (!cam_from_rig) continue;
      const auto image = image_index.find(static_cast<ImageId>(data.data_id));
      if (image == image_index.end()) continue;
      Place(static_cast<int32_t>(f), frame.rig_from_world, *cam_from_rig,
            &(*images)[image->second]);
    }
  }
}

}  // namespace

std::vector<ImageGeometry> ImageGeometries(const Model& model) {
  const auto camera_index = IndicesById<CameraId>(model.cameras);
  std::vector<ImageGeometry> images(model.images.size());
  for (size_t n = 0; n < images.size(); ++n) {
    const Image& image = model.images[n];
    images[n].camera = camera_index.at(image.camera_id);
    if (!model.has_rigs) {
      Place(static_cast<int32_t>(n), image.cam_from_world, Pose(), &images[n]);
    }
  }
  if (model.has_rigs) PlaceByFrames(model, &images);
  return images;
}

std::unordered_map<ImageId, int32_t> ImageIndices(const Model& model) {
  return IndicesById<ImageId>(model.images);
}

}  // namespace krot
