#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace krot {

// What is known about one of COLMAP's camera models by its id.
struct CameraModelInfo {
  int id;
  std::string_view name;         // "SIMPLE_RADIAL"
  std::string_view param_names;  // "f, cx, cy, k"
  int num_params;
  // False for EQUIRECTANGULAR, which has no image plane z = 1.
  bool has_image_plane;
};

// All models, in the order of their ids.
const std::vector<CameraModelInfo>& CameraModels();

// nullptr if there is no such model.
const CameraModelInfo* FindCameraModel(int id);
const CameraModelInfo* FindCameraModel(std::string_view name);

// The pixel of the ray (u, 1). Requires a known id with has_image_plane and
// as many parameters as the model has. The result may be non-finite where the
// model is not defined.
Eigen::Vector2d ProjectRay(int model_id, const double* params,
                           const Eigen::Vector2d& u);

// d pixel / d u at u: 2x2.
Eigen::Matrix2d ProjectionJacobian(int model_id, const double* params,
                                   const Eigen::Vector2d& u);

// An observation undistorted onto the plane z = 1 (DESIGN-level rule in
// docs/method.md, "The residual in pixels").
struct UndistortedObservation {
  Eigen::Vector2d u;  // ProjectRay(u) = pixel to 1e-8 px
  Eigen::Matrix2d J;  // d pixel / d u at u, det J > 0
};

enum class UndistortStatus {
  kOk,
  kNotConverged,  // Newton does not reproduce the pixel, or det J <= 0 on the
                  // segment from the principal point: "undistortion"
  kOffAxis        // the ray is 90 degrees or more off the axis: "off_axis"
};

// Newton from `u_start` (the model's own projection), or from the distorted
// point if there is none or it does not lead there.
UndistortStatus UndistortPixel(int model_id, const double* params,
                               const Eigen::Vector2d& pixel,
                               const std::optional<Eigen::Vector2d>& u_start,
                               UndistortedObservation* result);

}  // namespace krot
