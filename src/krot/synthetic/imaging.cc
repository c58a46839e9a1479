#include "krot/synthetic/imaging.h"

#include <algorithm>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/projection_row.h"

namespace krot::internal {
namespace {

constexpr double kMaxTangent = 5.67;  // of 80 degrees

std::optional<Eigen::Vector2d> RayOf(const Camera& camera,
                                     const Eigen::Vector2d& pixel) {
  UndistortedObservation undistorted;
  if (UndistortPixel(camera.model_id, camera.params.data(), pixel, std::nullopt,
                     &undistorted) != UndistortStatus::kOk) {
    return std::nullopt;
  }
  return undistorted.u;
}

// The largest ||u|| on the image's border, which bounds that of its interior:
// beyond it, a projection may fold back into the image.
double MaxRayRadius(const Camera& camera) {
  constexpr int kSamplesPerSide = 16;
  const double width = static_cast<double>(camera.width);
  const double height = static_cast<double>(camera.height);
  double max_radius = 0;
  for (int n = 0; n <= kSamplesPerSide; ++n) {
    const double x = width * n / kSamplesPerSide;
    const double y = height * n / kSamplesPerSide;
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(x, 0), Eigen::Vector2d(x, height),
          Eigen::Vector2d(0, y), Eigen::Vector2d(width, y)}) {
      const std::optional<Eigen::Vector2d> u = RayOf(camera, pixel);
      CheckArgument(u.has_value(), "focal_length_factor",
                    camera.params[0] / std::max(width, height),
                    "large enough for every pixel to have a ray");
      max_radius = std::max(max_radius, u->norm());
    }
  }
  return std::min(max_radius, kMaxTangent);
}

}  // namespace

Imaging::Imaging(const Camera& camera, double margin_px,
                 const std::vector<Pose>& cam_from_world)
    : camera_(camera),
      lower_(margin_px, margin_px),
      upper_(static_cast<double>(camera.width) - margin_px,
             static_cast<double>(camera.height) - margin_px),
      has_image_plane_(FindCameraModel(camera.model_id)->has_image_plane),
      max_ray_radius_(has_image_plane_ ? MaxRayRadius(camera) : 0) {
  for (const Pose& pose : cam_from_world) {
    cam_from_world_.push_back(pose.Transform());
  }
}

std::optional<Eigen::Vector2d> Imaging::Project(
    int image, const Eigen::Vector3d& x_world) const {
  const size_t j = static_cast<size_t>(image);
  const Eigen::Vector3d x_cam = cam_from_world_[j] * x_world;
  const double depth = has_image_plane_ ? x_cam.z() : x_cam.norm();
  if (depth < kMinDepth) return std::nullopt;
  if (has_image_plane_ && x_cam.hnormalized().norm() > max_ray_radius_) {
    return std::nullopt;
  }
  const Eigen::Vector2d pixel =
      ProjectPoint(camera_.model_id, camera_.params.data(), x_cam).value();
  const bool inside = (pixel.array() >= lower_.array()).all() &&
                      (pixel.array() <= upper_.array()).all();
  if (!inside) return std::nullopt;
  return pixel;
}

std::optional<Eigen::Vector3d> Imaging::PointAt(int image,
                                                const Eigen::Vector2d& fraction,
                                                double depth) const {
  const size_t j = static_cast<size_t>(image);
  const RigidTransform& pose = cam_from_world_[j];
  const Eigen::Vector2d pixel = lower_ + fraction.cwiseProduct(upper_ - lower_);
  std::optional<Eigen::Vector3d> ray;  // at depth 1
  if (has_image_plane_) {
    const std::optional<Eigen::Vector2d> u = RayOf(camera_, pixel);
    if (u) ray = u->homogeneous();
  } else {
    ray = PixelBearing(camera_.model_id, camera_.params.data(), pixel);
  }
  if (!ray) return std::nullopt;
  const Eigen::Vector3d x_cam = depth * *ray;
  const Eigen::Vector3d x_world =
      pose.rotation.transpose() * (x_cam - pose.translation);
  if (!Project(image, x_world)) return std::nullopt;
  return x_world;
}

}  // namespace krot::internal
