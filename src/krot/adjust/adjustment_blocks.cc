#include "krot/adjust/adjustment_blocks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include "krot/base/numbers.h"
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

bool IsUsable(const ImageGeometry& geometry, const Camera& camera,
              const Vector3d& xyz, const Point2D& pixel) {
  const Vector3d x_cam = geometry.cam_from_world * xyz;
  if (!(x_cam.z() > 0)) return false;
  const Eigen::Vector2d projected = ProjectRay(camera, x_cam.hnormalized());
  return std::isfinite(
      (projected - Eigen::Vector2d(pixel.x, pixel.y)).squaredNorm());
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
      const Point2D& pixel = model.images[n].points2D[element.point2D_idx];
      if (!geometry.has_pose) {
        ++blocks->num_no_pose;
      } else if (!IsUsable(geometry, camera, point.xyz, pixel)) {
        ++blocks->num_behind;
      } else {
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

// A sensor through which a fixed frame sees is fixed, too: otherwise the
// frame's images would move along.
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

std::vector<int32_t> SensorOffsets(const Model& model) {
  std::vector<int32_t> offsets;
  int32_t offset = 0;
  for (const Rig& rig : model.rigs) {
    offsets.push_back(offset);
    offset += static_cast<int32_t>(rig.sensors.size());
  }
  return offsets;
}

int32_t SensorBlock(const ImageGeometry& image,
                    const std::vector<int32_t>& offsets) {
  return image.sensor < 0 ? -1 : offsets[image.rig] + image.sensor;
}

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

Vector3d CenterOf(const PoseBlock& block) {
  return Center({RotationOf(block), TranslationOf(block)});
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

std::vector<int64_t> PointBegins(const AdjustmentBlocks& blocks) {
  std::vector<int64_t> begins(blocks.points.size() + 1, 0);
  for (const AdjustmentObservation& observation : blocks.observations) {
    ++begins[observation.point + 1];
  }
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  return begins;
}

namespace {

// Compares bits, so that a NaN counts as unchanged, too.
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

namespace {

using Eigen::Quaterniond;

Quaterniond ToRotation(const Vector3d& axis_angle) {
  const double angle = axis_angle.norm();
  if (angle == 0) return Quaterniond::Identity();
  return Quaterniond(Eigen::AngleAxisd(angle, axis_angle / angle));
}

void MovePose(const AdjustmentColumns::Pose& columns, const PoseBlock& from,
              const std::vector<Vector3d>& direction, double step,
              PoseBlock* to) {
  if (columns.center == AdjustmentColumns::kHeld) return;
  const Vector3d center = CenterOf(from) + step * direction[columns.center];
  if (columns.rotation != AdjustmentColumns::kHeld) {
    const Quaterniond q = (Quaterniond(from[0], from[1], from[2], from[3]) *
                           ToRotation(step * direction[columns.rotation]))
                              .normalized();
    std::copy_n(ToWxyz(q).begin(), 4, to->begin());
  }
  Eigen::Map<Vector3d>(to->data() + 4) = -(RotationOf(*to) * center);
}

}  // namespace

std::vector<int> RefinedParams(int camera_model,
                               const BundleAdjustmentOptions& options) {
  const CameraModelInfo& info = *FindCameraModel(camera_model);
  const int num_focal = info.num_focal_lengths();
  std::vector<int> refined;
  for (int i = 0; i < info.num_params; ++i) {
    const bool is_refined = i < num_focal       ? options.refine_focal_length
                            : i < num_focal + 2 ? options.refine_principal_point
                                                : options.refine_extra_params;
    if (is_refined) refined.push_back(i);
  }
  return refined;
}

AdjustmentColumns::AdjustmentColumns(const BundleAdjustmentOptions& options,
                                     const AdjustmentBlocks& blocks)
    : point_moves(blocks.points.size(), options.refine_points3D),
      kept_points(blocks.points.size(), kHeld),
      frames(blocks.frames.size()),
      sensors(blocks.sensors.size()),
      cameras(blocks.cameras.size()) {
  std::vector<char> has_frame(frames.size(), 0), has_sensor(sensors.size(), 0),
      has_camera(cameras.size(), 0);
  for (size_t k = 0; k < point_moves.size(); ++k) {
    if (blocks.point_is_fixed[k]) point_moves[k] = 0;
  }
  int32_t last_point = -1;
  for (const AdjustmentObservation& observation : blocks.observations) {
    has_frame[observation.frame] = 1;
    has_camera[observation.camera] = 1;
    if (observation.sensor >= 0) has_sensor[observation.sensor] = 1;
    if (point_moves[observation.point] && observation.point != last_point) {
      num_unknowns += 3;
    }
    last_point = observation.point;
  }
  const auto add_poses = [&](const std::vector<char>& is_used,
                             const std::vector<char>& is_fixed, bool rotates,
                             std::vector<Pose>* poses) {
    for (size_t i = 0; i < poses->size(); ++i) {
      if (!is_used[i] || is_fixed[i]) continue;
      if (rotates) (*poses)[i].rotation = num_blocks++;
      (*poses)[i].center = num_blocks++;
      num_unknowns += rotates ? 6 : 3;
    }
  };
  if (options.refine_rig_from_world) {
    add_poses(has_frame, blocks.frame_is_fixed,
              !options.constant_rig_from_world_rotation, &frames);
  }
  if (options.refine_sensor_from_rig) {
    add_poses(has_sensor, blocks.sensor_is_fixed, true, &sensors);
  }
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (!has_camera[c]) continue;
    cameras[c].params = RefinedParams(blocks.camera_models[c], options);
    cameras[c].first_block = num_blocks;
    num_blocks += cameras[c].num_blocks();
    num_unknowns += static_cast<int64_t>(cameras[c].params.size());
  }
}

void MoveAlong(const AdjustmentColumns& columns, const AdjustmentBlocks& from,
               const BlockVector& direction, double step,
               AdjustmentBlocks* to) {
  const std::vector<Vector3d>& blocks = direction.frames;
  for (size_t k = 0; k < from.points.size(); ++k) {
    if (!columns.point_moves[k]) continue;
    to->points[k] = from.points[k] + step * direction.points[k];
  }
  for (size_t f = 0; f < from.frames.size(); ++f) {
    MovePose(columns.frames[f], from.frames[f], blocks, step, &to->frames[f]);
  }
  for (size_t s = 0; s < from.sensors.size(); ++s) {
    MovePose(columns.sensors[s], from.sensors[s], blocks, step,
             &to->sensors[s]);
  }
  for (size_t c = 0; c < from.cameras.size(); ++c) {
    const AdjustmentColumns::Camera& camera = columns.cameras[c];
    for (size_t n = 0; n < camera.params.size(); ++n) {
      const int i = camera.params[n];
      to->cameras[c][i] =
          from.cameras[c][i] + step * blocks[camera.first_block + n / 3][n % 3];
    }
  }
  if (columns.cap != AdjustmentColumns::kHeld) {
    to->cap2 = from.cap2 + step * blocks[columns.cap][0];
  }
}

std::vector<AdjustmentComponent> FindComponents(const AdjustmentBlocks& blocks,
                                                bool refine_sensors) {
  const size_t num_frames = blocks.frames.size();
  const size_t num_sensors = blocks.sensors.size();
  const size_t num_nodes = num_frames + num_sensors + blocks.points.size();
  DisjointSets nodes(static_cast<int64_t>(num_nodes));
  std::vector<bool> is_used(num_nodes, false);
  std::vector<bool> is_scaled(num_nodes, false);
  for (const AdjustmentObservation& observation : blocks.observations) {
    const size_t frame = observation.frame;
    const size_t point = num_frames + num_sensors + observation.point;
    is_used[frame] = is_used[point] = true;
    nodes.Unite(point, frame);
    if (observation.sensor < 0) continue;
    const size_t sensor = num_frames + observation.sensor;
    if (refine_sensors) {
      is_used[sensor] = true;
      nodes.Unite(sensor, frame);
    } else if (TranslationOf(blocks.sensors[observation.sensor]).norm() > 0) {
      is_scaled[frame] = true;
    }
  }

  std::vector<bool> is_held(num_nodes, false);
  for (size_t f = 0; f < num_frames; ++f) is_held[f] = blocks.frame_is_fixed[f];
  for (size_t k = 0; k < blocks.points.size(); ++k) {
    is_held[num_frames + num_sensors + k] = blocks.point_is_fixed[k];
  }
  const auto node_of = [&](const Place& place) {
    return place.point >= 0 ? num_frames + num_sensors + place.point
                            : size_t(place.frame);
  };
  for (const PositionObservation& position : blocks.positions) {
    is_held[node_of(position.of)] = true;
  }
  for (const DistanceObservation& distance : blocks.distances) {
    if (distance.px_from_world > 0) is_scaled[node_of(distance.ends[0])] = true;
  }

  std::map<size_t, AdjustmentComponent> components;
  for (size_t node = 0; node < num_nodes; ++node) {
    if (!is_used[node]) continue;
    AdjustmentComponent& component = components[nodes.Find(node)];
    component.is_held = component.is_held || is_held[node];
    component.has_fixed_scale = component.has_fixed_scale || is_scaled[node];
    if (node < num_frames) {
      component.frames.push_back(node);
    } else if (node < num_frames + num_sensors) {
      component.sensors.push_back(node - num_frames);
    } else {
      component.points.push_back(node - num_frames - num_sensors);
    }
  }
  std::vector<AdjustmentComponent> list;
  for (auto& [root, component] : components) {
    list.push_back(std::move(component));
  }
  return list;
}

}  // namespace krot::internal
