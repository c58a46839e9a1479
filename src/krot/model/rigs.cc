#include "krot/model/rigs.h"

#include "krot/model.h"

namespace krot::internal {
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

// Composes the pose of `image` from its frame's pose and its sensor's pose in
// the rig.
void Place(const Pose& rig_from_world, const Pose& cam_from_rig,
           ImageGeometry* image) {
  image->rig_from_world = rig_from_world.Transform();
  image->cam_from_rig = cam_from_rig.Transform();
  image->cam_from_world = image->cam_from_rig * image->rig_from_world;
  image->has_pose = image->cam_from_world.translation.allFinite() &&
                    image->rig_from_world.rotation.allFinite();
}

}  // namespace

std::vector<ImageGeometry> ImageGeometries(const Model& model) {
  const auto camera_index = IndicesById<CameraId>(model.cameras);
  const auto rig_index = IndicesById<RigId>(model.rigs);
  const auto image_index = ImageIndices(model);
  std::vector<ImageGeometry> images(model.images.size());
  for (size_t n = 0; n < images.size(); ++n) {
    images[n].camera = camera_index.at(model.images[n].camera_id);
  }
  for (size_t f = 0; f < model.frames.size(); ++f) {
    const Frame& frame = model.frames[f];
    const int32_t rig = rig_index.at(frame.rig_id);
    for (const FrameData& data : frame.data) {
      if (data.sensor_id.type != kSensorTypeCamera) continue;
      const std::optional<SensorPlace> place =
          FindSensor(model.rigs[rig], data.sensor_id);
      if (!place || !place->sensor_from_rig) continue;
      const auto found = image_index.find(static_cast<ImageId>(data.data_id));
      if (found == image_index.end()) continue;
      ImageGeometry& image = images[found->second];
      image.frame = static_cast<int32_t>(f);
      image.rig = rig;
      image.sensor = place->index;
      Place(frame.rig_from_world, *place->sensor_from_rig, &image);
    }
  }
  return images;
}

std::optional<SensorPlace> FindSensor(const Rig& rig,
                                      const SensorId& sensor_id) {
  if (rig.ref_sensor_id && *rig.ref_sensor_id == sensor_id) {
    return SensorPlace{-1, Pose()};
  }
  for (size_t i = 0; i < rig.sensors.size(); ++i) {
    if (!(rig.sensors[i].sensor_id == sensor_id)) continue;
    return SensorPlace{static_cast<int32_t>(i), rig.sensors[i].sensor_from_rig};
  }
  return std::nullopt;
}

std::unordered_map<ImageId, int32_t> ImageIndices(const Model& model) {
  return IndicesById<ImageId>(model.images);
}

namespace {

struct Entry {
  int32_t type;
  std::string_view name;
};
constexpr Entry kEntries[] = {{kSensorTypeInvalid, "INVALID"},
                              {kSensorTypeCamera, "CAMERA"},
                              {kSensorTypeImu, "IMU"}};

}  // namespace

std::optional<std::string_view> SensorTypeName(int32_t type) {
  for (const Entry& entry : kEntries) {
    if (entry.type == type) return entry.name;
  }
  return std::nullopt;
}

std::optional<int32_t> SensorTypeFromName(std::string_view name) {
  for (const Entry& entry : kEntries) {
    if (entry.name == name) return entry.type;
  }
  return std::nullopt;
}

void UseTrivialRigs(Model* model) {
  model->rigs.clear();
  for (const Camera& camera : model->cameras) {
    const SensorId sensor_id{kSensorTypeCamera, camera.id};
    model->rigs.push_back({camera.id, sensor_id, {}});
  }
  model->frames.clear();
  for (const Image& image : model->images) {
    const SensorId sensor_id{kSensorTypeCamera, image.camera_id};
    model->frames.push_back({image.id,
                             image.camera_id,
                             image.cam_from_world,
                             {{sensor_id, image.id}}});
  }
}

}  // namespace krot::internal
