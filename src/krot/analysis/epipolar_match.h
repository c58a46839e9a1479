#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/camera/camera_model.h"
#include "krot/model.h"

namespace krot::internal {

// A pixel's ray, and its derivatives by the pixel's two coordinates.
struct PixelRay {
  Eigen::Vector3d ray;
  Eigen::Matrix<double, 3, 2> by_pixel;
};

inline PixelRay operator*(const Eigen::Matrix3d& rotation,
                          const PixelRay& pixel) {
  return {rotation * pixel.ray, rotation * pixel.by_pixel};
}

// In camera axes; none if no ray less than 90 degrees off the axis projects to
// the pixel, and for cameras without an image plane.
inline std::optional<PixelRay> RayOf(const Camera& camera,
                                     const Eigen::Vector2d& pixel) {
  const CameraModelInfo* info = FindCameraModel(camera.model_id);
  UndistortedObservation undistorted;
  if (info == nullptr || !info->has_image_plane ||
      UndistortPixel(camera.model_id, camera.params.data(), pixel, std::nullopt,
                     &undistorted) != UndistortStatus::kOk) {
    return std::nullopt;
  }
  PixelRay ray;
  ray.ray = undistorted.u.homogeneous();
  ray.by_pixel << undistorted.J.inverse(), 0, 0;
  return ray;
}

// A match of two images whose rotations are known, as a condition on the
// baseline b, the direction from one centre to the other: b, and the rays d1
// and d2 of the two pixels, all in world axes, lie in one plane if
// b . (d1 x d2) = 0.
struct EpipolarMatch {
  Eigen::Vector3d normal;  // d1 x d2
  // Its derivatives by the four coordinates of the two pixels, as rows.
  Eigen::Matrix<double, 4, 3> gradient;

  EpipolarMatch(const PixelRay& ray1, const PixelRay& ray2)
      : normal(ray1.ray.cross(ray2.ray)) {
    for (int i = 0; i < 2; ++i) {
      gradient.row(i) = ray1.by_pixel.col(i).cross(ray2.ray);
      gradient.row(2 + i) = ray1.ray.cross(ray2.by_pixel.col(i));
    }
  }

  // How far the two pixels must move together, in pixels and to first order,
  // until both lie on their epipolar lines (Sampson's distance), with the side
  // on which they are. The baseline's length does not matter; 0 where it gives
  // no lines.
  double SignedErrorPx(const Eigen::Vector3d& baseline) const {
    const double change = (gradient * baseline).norm();
    return change > 0 ? normal.dot(baseline) / change : 0;
  }
  double ErrorPx(const Eigen::Vector3d& baseline) const {
    return std::abs(SignedErrorPx(baseline));
  }
};

}  // namespace krot::internal
