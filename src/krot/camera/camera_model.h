#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace krot::internal {

// COLMAP's camera models, chosen at run time by their ids. Loops over many
// observations of one camera can dispatch once instead: VisitCameraModel in
// models.h and Undistort in undistort.h.

// What is known about one of COLMAP's camera models by its id.
struct CameraModelInfo {
  int id;
  std::string_view name;         // "SIMPLE_RADIAL"
  std::string_view param_names;  // "f, cx, cy, k"
  int num_params;
  // False for EQUIRECTANGULAR, which has no image plane z = 1.
  bool has_image_plane;
};

// All models, in the order of their ids, which run from 0 without gaps.
const std::vector<CameraModelInfo>& CameraModels();

// nullptr if there is no such model.
const CameraModelInfo* FindCameraModel(int id);
const CameraModelInfo* FindCameraModel(std::string_view name);

// The functions below throw std::invalid_argument if `model_id` is unknown or
// has no image plane. `params` holds as many parameters as the model has.

// The pixel of the ray (u, 1), as COLMAP defines it; the centre of the upper
// left pixel is (0.5, 0.5). Not finite where the model is not defined.
Eigen::Vector2d ProjectRay(int model_id, const double* params,
                           const Eigen::Vector2d& u);

// d pixel / d u at u, 2x2, exact (by forward differentiation).
Eigen::Matrix2d ProjectionJacobian(int model_id, const double* params,
                                   const Eigen::Vector2d& u);

// An observation undistorted onto the plane z = 1, with what the residual in
// pixels needs (docs/method/problem.md, "From pixels to rays").
struct UndistortedObservation {
  Eigen::Vector2d u;  // |ProjectRay(u) - pixel| <= 1e-8 px
  Eigen::Matrix2d J;  // d pixel / d u at u, det J > 0
};

enum class UndistortStatus {
  kOk,
  kNotConverged,  // no ray reproduces the pixel with det J > 0 from the axis
                  // to the ray, or none was found: "undistortion"
  kOffAxis        // that ray is 90 degrees or more off the axis: "off_axis"
};

// The ray u whose projection is the pixel and that lies before the first fold
// of the model: det J > 0 on the whole segment from the axis, u = 0, to u.
//
// Newton's method, in the plane of the distorted lens image, started at
// `u_start` (the model's own projection, if it has one in front of the
// camera), then at the distorted point, then at the axis, each only if those
// before it ended elsewhere; from the axis no step leaves the segment rule.
// The rule does not mention the start, and so the outcome does not depend on
// it: the status is the same from any start, and u up to rounding. (What could
// still differ is whether the search from the axis arrives: over 5,000 random,
// mostly strong cameras of every model and six starts each, it failed to in 2
// of 510,000 trials, both of RAD_TAN_THIN_PRISM_FISHEYE past 90 degrees.)
// Models without a distortion polynomial are inverted in closed form.
//
// Sets *result only for kOk. 0.1 to 0.5 microseconds for ordinary distortions
// from a start a few pixels off; tens of microseconds where no ray exists.
UndistortStatus UndistortPixel(int model_id, const double* params,
                               const Eigen::Vector2d& pixel,
                               const std::optional<Eigen::Vector2d>& u_start,
                               UndistortedObservation* result);

}  // namespace krot::internal
