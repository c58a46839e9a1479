#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// The nearest that a point may be to an image that sees it, in viewing
// distances.
inline constexpr double kMinDepth = 0.2;

// Which points the images of a scene see, and where: all images are taken
// with copies of one camera.
class Imaging {
 public:
  // A point is in view if it is `margin_px` or more inside the image's
  // border, at least kMinDepth away and, but for panoramas, less than 80
  // degrees off the axis.
  // Throws std::invalid_argument if the camera has no ray for a pixel of the
  // border.
  Imaging(const Camera& camera, double margin_px,
          const std::vector<Pose>& cam_from_world);

  int num_images() const { return static_cast<int>(cam_from_world_.size()); }

  // The exact pixel of the point if it is in view.
  std::optional<Eigen::Vector2d> Project(int image,
                                         const Eigen::Vector3d& x_world) const;

  // The point on the ray of the pixel at a fraction of width and height, at
  // the given depth, on a panorama distance, if it is in view.
  std::optional<Eigen::Vector3d> PointAt(int image,
                                         const Eigen::Vector2d& fraction,
                                         double depth) const;

 private:
  Camera camera_;
  Eigen::Vector2d lower_;  // pixels in view
  Eigen::Vector2d upper_;
  bool has_image_plane_ = true;
  double max_ray_radius_ = 0;  // ||u|| on z = 1, if there is one
  std::vector<RigidTransform> cam_from_world_;
};

}  // namespace krot::internal
