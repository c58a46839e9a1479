#include <vector>

#include "krot/base/check.h"
#include "krot/bridge/bridge.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Stored poses that agree to this with those of frames and rigs differ by
// rounding alone: quaternions and translations relative to their size.
constexpr double kSamePose = 1e-9;

bool IsSamePoint(const Vector3d& a, const Vector3d& b) {
  return (a - b).norm() <= kSamePose * a.norm();
}

// Makes the image agree with its frame, whose translation was `geometry`'s
// and is now `translation`.
void FollowFrame(const ImageGeometry& geometry, const Vector3d& translation,
                 Pose* cam_from_world) {
  const bool has_same_rotation =
      (cam_from_world->Rotation() - geometry.cam_from_world.rotation).norm() <=
      kSamePose;
  if (!has_same_rotation) {
    cam_from_world->quaternion_wxyz =
        ToWxyz(Eigen::Quaterniond(geometry.cam_from_world.rotation));
  }
  const bool frame_stays = translation == geometry.rig_from_world.translation;
  if (frame_stays && IsSamePoint(geometry.cam_from_world.translation,
                                 cam_from_world->translation)) {
    return;
  }
  cam_from_world->translation = geometry.cam_from_rig * translation;
}

}  // namespace

Estimate OwnEstimate(const Model& model, const BuiltProblem& built) {
  Estimate estimate;
  for (const int32_t frame : built.frame_of) {
    estimate.translations.push_back(
        model.frames[frame].rig_from_world.translation);
  }
  for (const int32_t point : built.point_of) {
    estimate.points.push_back(model.points3D[point].xyz);
  }
  // What stands behind the model's does not move.
  const Estimate& start = built.start;
  estimate.translations.insert(
      estimate.translations.end(),
      start.translations.begin() +
          static_cast<std::ptrdiff_t>(built.frame_of.size()),
      start.translations.end());
  estimate.points.insert(
      estimate.points.end(),
      start.points.begin() + static_cast<std::ptrdiff_t>(built.point_of.size()),
      start.points.end());
  return estimate;
}

Model ApplyEstimate(const Model& model, const BuiltProblem& built,
                    const Estimate& estimate) {
  CheckArgument(estimate.translations.size() == built.start.translations.size(),
                "estimate.translations.size()", estimate.translations.size(),
                "the number of frames");
  CheckArgument(estimate.points.size() == built.start.points.size(),
                "estimate.points.size()", estimate.points.size(),
                "the number of points");

  Model result = model;
  for (size_t k = 0; k < built.point_of.size(); ++k) {
    result.points3D[built.point_of[k]].xyz = estimate.points[k];
  }
  for (size_t f = 0; f < built.frame_of.size(); ++f) {
    result.frames[built.frame_of[f]].rig_from_world.translation =
        estimate.translations[f];
  }
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t j = 0; j < built.image_of.size(); ++j) {
    const int32_t image = built.image_of[j];
    FollowFrame(geometries[image],
                estimate.translations[built.problem.views[j].frame],
                &result.images[image].cam_from_world);
  }
  return result;
}

}  // namespace krot::internal
