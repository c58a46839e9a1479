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

Ray RayOf(const ImageGeometry& image, const Observation& observation) {
  const RigidTransform world_from_cam = Inverse(image.cam_from_world);
  return {world_from_cam.translation,
          world_from_cam.rotation * observation.u.homogeneous().normalized()};
}

}  // namespace

bool IsInFront(const ImageGeometry& image, const Vector3d& xyz) {
  const double depth = image.cam_from_world.rotation.row(2).dot(xyz) +
                       image.cam_from_world.translation.z();
  return depth > kDepthRounding *
                     (xyz.norm() + image.cam_from_world.translation.norm());
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
