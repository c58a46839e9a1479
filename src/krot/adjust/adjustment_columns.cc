#include "krot/adjust/adjustment_columns.h"

#include <algorithm>

#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

Quaterniond ToRotation(const Vector3d& axis_angle) {
  const double angle = axis_angle.norm();
  if (angle == 0) return Quaterniond::Identity();
  return Quaterniond(Eigen::AngleAxisd(angle, axis_angle / angle));
}

void MovePose(const AdjustmentColumns::Pose& columns, const PoseBlock& from,
              const std::vector<Vector3d>& direction, double step,
              PoseBlock* to) {
  if (columns.center == AdjustmentColumns::kHeld) return;
  const Vector3d center = Center({RotationOf(from), TranslationOf(from)}) +
                          step * direction[columns.center];
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
  const int num_focal = info.param_names.substr(0, 2) == "fx" ? 2 : 1;
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

}  // namespace krot::internal
