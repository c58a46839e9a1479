#include "krot/convert/build_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/minimax/residual_set.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Stored poses that differ from those of frames and rigs by less than this
// differ by rounding alone; quaternions, and translations relative to their
// size.
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
  // Known positions add frames and points behind the model's; these do not
  // move.
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

namespace {

// The largest error of a point's observations, only over those whose error was
// finite before; infinite if one of these no longer projects.
class TrackError {
 public:
  TrackError(const Model& model, const std::vector<double>& errors_before_px,
             Norm norm)
      : model_(model),
        errors_before_px_(errors_before_px),
        norm_(norm),
        images_(ImageGeometries(model)),
        image_indices_(ImageIndices(model)) {}

  double operator()(const Point3D& point, const Vector3d& xyz) const {
    double largest = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_before_px_[e])) continue;
      const TrackElement& element = model_.track_elements[e];
      const int32_t n = image_indices_.at(element.image_id);
      const Point2D& point2D = model_.images[n].points2D[element.point2D_idx];
      const Camera& camera = model_.cameras[images_[n].camera];
      const auto error = ProjectionError(camera.model_id, camera.params.data(),
                                         {point2D.x, point2D.y},
                                         images_[n].cam_from_world * xyz);
      if (!error) return std::numeric_limits<double>::infinity();
      largest = std::max(largest, NormOf(*error, norm_));
    }
    return largest;
  }

  const std::vector<ImageGeometry>& images() const { return images_; }
  int32_t ImageOf(const TrackElement& element) const {
    return image_indices_.at(element.image_id);
  }

 private:
  const Model& model_;
  const std::vector<double>& errors_before_px_;
  const Norm norm_;
  const std::vector<ImageGeometry> images_;
  const std::unordered_map<ImageId, int32_t> image_indices_;
};

}  // namespace

void CarryLeftOutPoints(const Model& before,
                        const std::vector<double>& errors_px, Norm norm,
                        const BuiltProblem& built, const FixedParts& fixed,
                        double level, Model* after) {
  std::vector<char> is_in(before.points3D.size(), 0);
  for (const int32_t k : built.point_of) is_in[k] = 1;
  if (std::count(is_in.begin(), is_in.end(), 0) == 0) return;

  const TrackError error_before(before, errors_px, norm);
  const TrackError error_after(*after, errors_px, norm);
  for (size_t k = 0; k < is_in.size(); ++k) {
    if (is_in[k] || fixed.HasPoint(static_cast<int32_t>(k))) continue;
    Point3D& point = after->points3D[k];
    const Vector3d& start = before.points3D[k].xyz;
    const double allowed =
        std::max(level, error_before(before.points3D[k], start));
    double lowest = error_after(point, start);
    for (uint64_t e = point.track_begin;
         e < point.track_end && lowest > allowed; ++e) {
      const int32_t n = error_after.ImageOf(after->track_elements[e]);
      const Vector3d xyz =
          start + (Center(error_after.images()[n].cam_from_world) -
                   Center(error_before.images()[n].cam_from_world));
      const double error = error_after(point, xyz);
      if (!(error < lowest)) continue;
      lowest = error;
      point.xyz = xyz;
    }
  }
}

}  // namespace krot::internal
