#include "krot/bridge/point_repair.h"

#include <algorithm>
#include <optional>

#include "krot/bridge/retriangulate.h"

namespace krot {
namespace {

using Eigen::Vector3d;

// Depths below this, relative to the coordinates that they are the difference
// of, may be rounding.
constexpr double kDepthRounding = 1e-14;

// C = -R' t; its direction is where v = 0 and w > 0.
Ray RayOf(const ImageGeometry& image, const Observation& observation) {
  const Eigen::Matrix3d world_from_cam =
      image.cam_from_world_rotation.transpose();
  Vector3d ray = observation.E.row(1).cross(observation.E.row(2));
  if (observation.E.row(0).dot(ray) < 0) ray = -ray;
  return {-world_from_cam * image.cam_from_world_translation,
          world_from_cam * ray.normalized()};
}

}  // namespace

bool IsInFront(const ImageGeometry& image, const Vector3d& xyz) {
  const double depth = image.cam_from_world_rotation.row(2).dot(xyz) +
                       image.cam_from_world_translation.z();
  return depth > kDepthRounding *
                     (xyz.norm() + image.cam_from_world_translation.norm());
}

RepairedPoint RepairPoint(const std::vector<ImageGeometry>& images,
                          const Observation* observations, int count,
                          const Vector3d& xyz) {
  const auto count_behind = [&](const Vector3d& point) {
    return std::count_if(observations, observations + count,
                         [&](const Observation& observation) {
                           return !IsInFront(images[observation.view], point);
                         });
  };
  const RepairedPoint as_stored{xyz, /*is_retriangulated=*/false};
  const auto num_behind = count_behind(xyz);
  if (num_behind == 0) return as_stored;

  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    rays.push_back(RayOf(images[observations[i].view], observations[i]));
  }
  const std::optional<Vector3d> midpoint = RetriangulateMidpoint(rays);
  if (!midpoint || count_behind(*midpoint) >= num_behind) return as_stored;
  return {*midpoint, /*is_retriangulated=*/true};
}

}  // namespace krot
