#include "krot/model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_map>

#include <Eigen/Geometry>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/minimax/residual_set.h"
#include "krot/model/rigs.h"

namespace krot {

using namespace internal;

namespace {

// x_cam = q x q^-1 + t.
struct CameraPose {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
};

// Normalised when read and again when used, and applied to points as a
// quaternion: these are the operations of COLMAP 3.8. Where a point nearly
// coincides with a camera centre, rounding decides its error, and should decide
// alike.
Eigen::Quaterniond NormalizedTwice(const Pose& pose) {
  Eigen::Vector4d q(pose.quaternion_wxyz.data());
  q /= q.norm();
  q /= q.norm();
  return {q[0], q[1], q[2], q[3]};
}

std::optional<CameraPose> CameraPoseOf(const Model& model,
                                       const ImageGeometry& geometry) {
  if (!geometry.has_pose) return std::nullopt;
  const bool is_frame_pose =
      geometry.cam_from_rig.rotation == Eigen::Matrix3d::Identity() &&
      geometry.cam_from_rig.translation == Eigen::Vector3d::Zero();
  if (!is_frame_pose) {
    return CameraPose{Eigen::Quaterniond(geometry.cam_from_world.rotation),
                      geometry.cam_from_world.translation};
  }
  const Pose& pose = model.frames[geometry.frame].rig_from_world;
  return CameraPose{NormalizedTwice(pose), pose.translation};
}

double PixelError(const CameraPose& pose, const Camera& camera,
                  const Point2D& point2D, const Eigen::Vector3d& xyz,
                  Norm norm) {
  const Eigen::Vector3d x_cam = pose.rotation * xyz + pose.translation;
  const std::optional<Eigen::Vector2d> difference = ProjectionError(
      camera.model_id, camera.params.data(), {point2D.x, point2D.y}, x_cam);
  if (!difference) return kNaN;
  const double error = NormOf(*difference, norm);
  return std::isfinite(error) ? error : kNaN;
}

}  // namespace

std::vector<double> PixelErrors(const Model& model, int num_threads,
                                Norm norm) {
  const std::unordered_map<ImageId, int32_t> image_indices =
      ImageIndices(model);
  std::vector<std::optional<CameraPose>> poses;
  std::vector<const Camera*> cameras;
  for (const ImageGeometry& geometry : ImageGeometries(model)) {
    poses.push_back(CameraPoseOf(model, geometry));
    cameras.push_back(&model.cameras[geometry.camera]);
  }

  std::vector<double> errors_px(model.track_elements.size(), kNaN);
  ParallelFor(
      static_cast<int64_t>(model.points3D.size()), kItemsPerChunk, num_threads,
      [&](int64_t begin, int64_t end, int) {
        for (int64_t k = begin; k < end; ++k) {
          const Point3D& point = model.points3D[k];
          for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
            const TrackElement& element = model.track_elements[e];
            const int32_t n = image_indices.at(element.image_id);
            if (!poses[n]) continue;
            errors_px[e] = PixelError(
                *poses[n], *cameras[n],
                model.images[n].points2D[element.point2D_idx], point.xyz, norm);
          }
        }
      });
  return errors_px;
}

PixelErrorStatistics Summarize(const std::vector<double>& errors_px) {
  std::vector<double> finite;
  finite.reserve(errors_px.size());
  double sum = 0;
  double sum_of_squares = 0;
  for (const double error : errors_px) {
    if (!std::isfinite(error)) continue;
    finite.push_back(error);
    sum += error;
    sum_of_squares += error * error;
  }

  PixelErrorStatistics statistics;
  statistics.count = static_cast<int64_t>(finite.size());
  statistics.not_finite =
      static_cast<int64_t>(errors_px.size()) - statistics.count;
  if (finite.empty()) return statistics;
  const double count = static_cast<double>(finite.size());
  statistics.mean = sum / count;
  statistics.rms = std::sqrt(sum_of_squares / count);
  // ceil(0.99 n)-th smallest, in integers.
  const auto rank = finite.begin() + ((99 * statistics.count + 99) / 100 - 1);
  std::nth_element(finite.begin(), rank, finite.end());
  statistics.p99 = *rank;
  statistics.max = *std::max_element(rank, finite.end());
  return statistics;
}

void UpdatePointErrors(const std::vector<double>& errors_px, Model* model) {
  CheckArgument(errors_px.size() == model->track_elements.size(),
                "errors_px.size()", errors_px.size(),
                "the number of track elements");
  for (Point3D& point : model->points3D) {
    double sum = 0;
    int64_t count = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_px[e])) continue;
      sum += errors_px[e];
      ++count;
    }
    point.error = count > 0 ? sum / static_cast<double>(count) : -1;
  }
}

}  // namespace krot
