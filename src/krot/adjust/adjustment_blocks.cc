#include "krot/adjust/adjustment_blocks.h"

#include <cmath>
#include <cstring>
#include <string>

#include "krot/camera/camera_model.h"
#include "krot/context.h"
#include "krot/geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

void CheckImagePlane(const Camera& camera) {
  const CameraModelInfo& info = *FindCameraModel(camera.model_id);
  if (info.has_image_plane) return;
  throw ModelError("camera " + std::to_string(camera.id) + " is " +
                   std::string(info.name) +
                   ", which has no image plane: expected a model that "
                   "projects onto one");
}

// Where the sensors of each rig begin in AdjustmentBlocks::sensors.
std::vector<int32_t> SensorOffsets(const Model& model) {
  std::vector<int32_t> offsets;
  int32_t offset = 0;
  for (const Rig& rig : model.rigs) {
    offsets.push_back(offset);
    offset += static_cast<int32_t>(rig.sensors.size());
  }
  return offsets;
}

// Index in AdjustmentBlocks::sensors; -1 for the reference sensor.
int32_t SensorBlock(const ImageGeometry& image,
                    const std::vector<int32_t>& offsets) {
  return image.sensor < 0 ? -1 : offsets[image.rig] + image.sensor;
}

bool IsUsable(const ImageGeometry& geometry, const Camera& camera,
              const Vector3d& xyz) {
  const Vector3d x_cam = geometry.cam_from_world * xyz;
  if (!(x_cam.z() > 0)) return false;
  return ProjectRay(camera.model_id, camera.params.data(), x_cam.hnormalized())
      .allFinite();
}

void CollectObservations(const Model& model, int min_track_length,
                         const FixedParts& fixed, AdjustmentBlocks* blocks) {
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  const std::vector<int32_t> sensor_offsets = SensorOffsets(model);
  const std::unordered_map<ImageId, int32_t> image_indices =
      ImageIndices(model);
  std::vector<bool> has_observation(images.size(), false);
  std::vector<int32_t> images_of_point;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    const size_t begin = blocks->observations.size();
    images_of_point.clear();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      const int32_t n = image_indices.at(element.image_id);
      const ImageGeometry& geometry = images[n];
      const Camera& camera = model.cameras[geometry.camera];
      CheckImagePlane(camera);
      if (!geometry.has_pose) {
        ++blocks->num_no_pose;
      } else if (!IsUsable(geometry, camera, point.xyz)) {
        ++blocks->num_behind;
      } else {
        const Point2D& pixel = model.images[n].points2D[element.point2D_idx];
        blocks->observations.push_back({geometry.frame,
                                        SensorBlock(geometry, sensor_offsets),
                                        geometry.camera,
                                        static_cast<int32_t>(k),
                                        {pixel.x, pixel.y},
                                        e});
        images_of_point.push_back(n);
      }
    }
    const auto length = static_cast<int>(images_of_point.size());
    if (length < min_track_length && !fixed.HasPoint(static_cast<int32_t>(k))) {
      blocks->num_short_track += length;
      blocks->observations.resize(begin);
    } else {
      for (const int32_t n : images_of_point) has_observation[n] = true;
    }
  }
  for (const bool has : has_observation) blocks->num_images += has ? 1 : 0;
}

// A sensor that moved would take the images of a fixed frame along.
void MarkFixed(const FixedParts& fixed, AdjustmentBlocks* blocks) {
  blocks->frame_is_fixed = fixed.frames;
  blocks->frame_is_fixed.resize(blocks->frames.size(), 0);
  blocks->point_is_fixed = fixed.points3D;
  blocks->point_is_fixed.resize(blocks->points.size(), 0);
  blocks->sensor_is_fixed.assign(blocks->sensors.size(), 0);
  for (const AdjustmentObservation& observation : blocks->observations) {
    if (observation.sensor >= 0 && blocks->frame_is_fixed[observation.frame]) {
      blocks->sensor_is_fixed[observation.sensor] = 1;
    }
  }
}

}  // namespace

PoseBlock ToBlock(const Pose& pose) {
  const QuaternionWxyz q = ToWxyz(NormalizedQuaternion(pose.quaternion_wxyz));
  const Vector3d& t = pose.translation;
  return {q[0], q[1], q[2], q[3], t[0], t[1], t[2]};
}

Pose ToPose(const PoseBlock& block) {
  return {{block[0], block[1], block[2], block[3]}, TranslationOf(block)};
}

Eigen::Matrix3d RotationOf(const PoseBlock& block) {
  return ToPose(block).Rotation();
}

Eigen::Map<const Vector3d> TranslationOf(const PoseBlock& block) {
  return Eigen::Map<const Vector3d>(block.data() + 4);
}

AdjustmentBlocks MakeAdjustmentBlocks(const Model& model, int min_track_length,
                                      const FixedParts& fixed) {
  AdjustmentBlocks blocks;
  for (const Frame& frame : model.frames) {
    blocks.frames.push_back(ToBlock(frame.rig_from_world));
  }
  for (const Rig& rig : model.rigs) {
    for (const RigSensor& sensor : rig.sensors) {
      blocks.sensors.push_back(
          ToBlock(sensor.sensor_from_rig.value_or(Pose())));
    }
  }
  for (const Camera& camera : model.cameras) {
    blocks.cameras.push_back(camera.params);
    blocks.camera_models.push_back(camera.model_id);
  }
  for (const Point3D& point : model.points3D) {
    blocks.points.push_back(point.xyz);
  }
  CollectObservations(model, min_track_length, fixed, &blocks);
  MarkFixed(fixed, &blocks);
  return blocks;
}

namespace {

// To the bit: a NaN stays, too.
bool IsSame(const PoseBlock& a, const PoseBlock& b) {
  return std::memcmp(a.data(), b.data(), sizeof(PoseBlock)) == 0;
}

}  // namespace

Model ApplyBlocks(const Model& model, const AdjustmentBlocks& before,
                  const AdjustmentBlocks& after) {
  Model result = model;
  for (size_t k = 0; k < after.points.size(); ++k) {
    result.points3D[k].xyz = after.points[k];
  }
  for (size_t c = 0; c < after.cameras.size(); ++c) {
    result.cameras[c].params = after.cameras[c];
  }
  size_t s = 0;
  for (Rig& rig : result.rigs) {
    for (RigSensor& sensor : rig.sensors) {
      if (after.sensors[s] != before.sensors[s]) {
        sensor.sensor_from_rig = ToPose(after.sensors[s]);
      }
      ++s;
    }
  }
  for (size_t f = 0; f < after.frames.size(); ++f) {
    if (IsSame(after.frames[f], before.frames[f])) continue;
    result.frames[f].rig_from_world = ToPose(after.frames[f]);
  }

  const std::vector<int32_t> sensor_offsets = SensorOffsets(model);
  const std::vector<ImageGeometry> images = ImageGeometries(result);
  for (size_t n = 0; n < images.size(); ++n) {
    const int32_t f = images[n].frame;
    if (f < 0) continue;
    const int32_t sensor = SensorBlock(images[n], sensor_offsets);
    const bool stays =
        IsSame(after.frames[f], before.frames[f]) &&
        (sensor < 0 || IsSame(after.sensors[sensor], before.sensors[sensor]));
    if (stays) continue;
    Pose& pose = result.images[n].cam_from_world;
    pose =
        sensor < 0 ? ToPose(after.frames[f]) : ToPose(images[n].cam_from_world);
  }
  return result;
}

}  // namespace krot::internal
