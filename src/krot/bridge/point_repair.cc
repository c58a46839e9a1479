#include "krot/bridge/point_repair.h"

#include <optional>

#include "krot/bridge/retriangulate.h"

namespace krot {
namespace {

using Eigen::Vector3d;

// C = -R' t; its direction is where v = 0 and w > 0.
Ray RayOf(const ImageGeometry& image, const Observation& observation) {
  const RigidTransform world_from_cam = Inverse(image.cam_from_world);
  Vector3d ray = observation.E.row(1).cross(observation.E.row(2));
  if (observation.E.row(0).dot(ray) < 0) ray = -ray;
  return {world_from_cam.translation,
          world_from_cam.rotation * ray.normalized()};
}

}  // namespace

RepairedPoint RepairPoint(
    const std::vector<ImageGeometry>& images, const Observation* observations,
    int count, const Vector3d& xyz,
    const std::function<bool(int, const Vector3d&)>& is_seen) {
  const auto count_unseen = [&](const Vector3d& point) {
    int num_unseen = 0;
    for (int i = 0; i < count; ++i) num_unseen += !is_seen(i, point);
    return num_unseen;
  };
  const RepairedPoint as_stored{xyz, /*is_retriangulated=*/false};
  const int num_unseen = count_unseen(xyz);
  if (num_unseen == 0) return as_stored;

  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    rays.push_back(RayOf(images[observations[i].view], observations[i]));
  }
  const std::optional<Vector3d> midpoint = RetriangulateMidpoint(rays);
  if (!midpoint || count_unseen(*midpoint) >= num_unseen) return as_stored;
  return {*midpoint, /*is_retriangulated=*/true};
}

}  // namespace krot
