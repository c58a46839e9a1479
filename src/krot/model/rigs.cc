#include "krot/model/rigs.h"

#include <algorithm>
#include <array>

#include "krot/camera/camera_model.h"
#include "krot/model.h"

namespace krot::internal {
namespace {

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
  const IdIndex<CameraId> camera_index(model.cameras);
  const IdIndex<RigId> rig_index(model.rigs);
  const IdIndex<ImageId> image_index(model.images);
  std::vector<ImageGeometry> images(model.images.size());
  for (size_t n = 0; n < images.size(); ++n) {
    images[n].camera = camera_index.Find(model.images[n].camera_id).value();
  }
  for (size_t f = 0; f < model.frames.size(); ++f) {
    const Frame& frame = model.frames[f];
    const int32_t rig = rig_index.Find(frame.rig_id).value();
    for (const FrameData& data : frame.data) {
      if (data.sensor_id.type != kSensorTypeCamera) continue;
      const std::optional<SensorPlace> place =
          FindSensor(model.rigs[rig], data.sensor_id);
      if (!place || !place->sensor_from_rig) continue;
      const auto found = image_index.Find(static_cast<ImageId>(data.data_id));
      if (!found) continue;
      ImageGeometry& image = images[*found];
      image.frame = static_cast<int32_t>(f);
      image.rig = rig;
      image.sensor = place->index;
      Place(frame.rig_from_world, *place->sensor_from_rig, &image);
    }
  }
  return images;
}

std::optional<PixelRay> RayOf(const Camera& camera,
                              const Eigen::Vector2d& pixel) {
  const auto undistorted = UndistortPixel(camera, pixel);
  if (!undistorted) return std::nullopt;
  PixelRay ray;
  ray.ray = undistorted->u.homogeneous();
  ray.by_pixel << undistorted->J.inverse(), 0, 0;
  return ray;
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
  std::unordered_map<ImageId, int32_t> indices;
  indices.reserve(model.images.size());
  for (size_t n = 0; n < model.images.size(); ++n) {
    indices.emplace(model.images[n].id, static_cast<int32_t>(n));
  }
  return indices;
}

std::unordered_map<std::string_view, int32_t> ImagesByName(const Model& model) {
  std::unordered_map<std::string_view, int32_t> indices;
  for (size_t n = 0; n < model.images.size(); ++n) {
    indices.emplace(model.images[n].name, static_cast<int32_t>(n));
  }
  return indices;
}

std::vector<int32_t> ImagesOfElements(const Model& model) {
  const auto indices = ImageIndices(model);
  std::vector<int32_t> images;
  images.reserve(model.track_elements.size());
  for (const TrackElement& element : model.track_elements) {
    images.push_back(indices.at(element.image_id));
  }
  return images;
}

namespace {

// Of the types from -1 on.
const std::array<std::string_view, 3> kSensorTypes = {"INVALID", "CAMERA",
                                                      "IMU"};

}  // namespace

std::optional<std::string_view> SensorTypeName(int32_t type) {
  if (type < -1 || type > 1) return std::nullopt;
  return kSensorTypes[static_cast<size_t>(type + 1)];
}

std::optional<int32_t> SensorTypeFromName(std::string_view name) {
  const auto found = std::find(kSensorTypes.begin(), kSensorTypes.end(), name);
  if (found == kSensorTypes.end()) return std::nullopt;
  return static_cast<int32_t>(found - kSensorTypes.begin()) - 1;
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

void FollowFrames(Model* model) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(*model);
  for (size_t n = 0; n < model->images.size(); ++n) {
    if (!geometries[n].rig_from_world.rotation.allFinite()) continue;
    model->images[n].cam_from_world = ToPose(geometries[n].cam_from_world);
  }
}

}  // namespace krot::internal
