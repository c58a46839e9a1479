#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"

namespace krot::internal {

// COLMAP's camera models, chosen at run time by their ids. Loops over many
// observations of one camera can dispatch once instead: VisitCameraModel in
// models.h and Undistort in undistort.h.

// Properties of one of COLMAP's camera models.
struct CameraModelInfo {
  int id;
  std::string_view name;         // "SIMPLE_RADIAL"
  std::string_view param_names;  // "f, cx, cy, k"
  int num_params;
  // False for EQUIRECTANGULAR, which has no image plane z = 1.
  bool has_image_plane;

  // Of its first parameters; the principal point's two follow. For models with
  // an image plane.
  int num_focal_lengths() const {
    return param_names.substr(0, 2) == "fx" ? 2 : 1;
  }
};

// All models, in the order of their ids, which run from 0 without gaps.
const std::vector<CameraModelInfo>& CameraModels();

// nullptr if there is no such model.
const CameraModelInfo* FindCameraModel(int id);
const CameraModelInfo* FindCameraModel(std::string_view name);

// A camera's model and its parameters, as many as the model has.
struct Intrinsics {
  Intrinsics(int id, const double* first) : model_id(id), params(first) {}
  Intrinsics(const Camera& camera)  // NOLINT(google-explicit-constructor)
      : Intrinsics(camera.model_id, camera.params.data()) {}

  int model_id;
  const double* params;
};

// All functions throw std::invalid_argument for an unknown model, ProjectRay
// and ProjectionJacobian also for one without an image plane.

// The pixel of the ray (u, 1), as COLMAP defines it; the centre of the upper
// left pixel is (0.5, 0.5). Not finite where the model is not defined.
Eigen::Vector2d ProjectRay(Intrinsics intrinsics, const Eigen::Vector2d& u);

// d pixel / d u at u, 2x2, exact (by forward differentiation).
Eigen::Matrix2d ProjectionJacobian(Intrinsics intrinsics,
                                   const Eigen::Vector2d& u);

// An observation undistorted onto the plane z = 1, with what the residual in
// pixels needs (docs/method/problem.md, "From pixels to rays").
struct UndistortedObservation {
  Eigen::Vector2d u;  // |ProjectRay(u) - pixel| <= 1e-8 px
  Eigen::Matrix2d J;  // d pixel / d u at u, det J > 0
};

// The ray u whose projection is the pixel and that lies before the first fold
// of the model: det J > 0 on the whole segment from the axis, u = 0, to u. None
// if there is no such ray, if none was found, if it is 90 degrees or more off
// the axis, or if the model has no image plane.
//
// Inverts the distortion by Newton's method in the lens plane. It starts at the
// distorted point; if that fails, at the axis. From there, every step keeps
// det J > 0 on the segment. Models without a distortion polynomial are inverted
// in closed form.
//
// 0.1 to 0.5 microseconds for ordinary distortions; tens of microseconds where
// no ray exists.
std::optional<UndistortedObservation> UndistortPixel(
    Intrinsics intrinsics, const Eigen::Vector2d& pixel);

// A plane n'X = 1 on which nearby rays of a camera have two coordinates p:
// X(p) = n + B p, with B'B = I, B'n = 0, |n| = 1.
struct Chart {
  Eigen::Vector3d n;
  Eigen::Matrix<double, 3, 2> B;
};

// The chart in which an observation is linearised whose point is in direction
// x_cam. It depends only on the model and on this direction:
//
//   perspective lens             z = 1, B = (e1, e2): without distortion the
//   (ids 0 to 4, 6)              projection is linear there;
//   division model (12, 13)      the same up to 80 degrees off the axis;
//   every other, and beyond      the plane tangent to the unit sphere at
//                                x_cam / |x_cam|.
//
// A fisheye is much closer to linear in the tangent plane than on z = 1: 60
// degrees off the axis, an equidistant lens has the radial curvature
// 2 tan(60) / f px^-1 on z = 1, but none in the tangent plane.
//
// nullopt if the point does not project: x_cam is zero or not finite, behind a
// perspective camera, or not seen by the lens (lens.h).
std::optional<Chart> ChartAt(Intrinsics intrinsics,
                             const Eigen::Vector3d& x_cam);

// d pixel / d p at the ray of x_cam, 2x2.
Eigen::Matrix2d ChartJacobian(Intrinsics intrinsics, const Chart& chart,
                              const Eigen::Vector3d& x_cam);

// The projection of points in the camera's frame, for every model, and its
// first-order expansion, from which the solver takes its rows.
//
// A point projects if the lens sees its direction: z > 0 for perspective
// lenses, almost all directions for fisheyes (lens.h), all for EQUIRECTANGULAR.
// COLMAP itself ends its fisheyes, FOV and EUCM at 90 degrees; here the same
// formulas of the angle continue beyond. The functions below return nullopt for
// a point that does not project, is zero or not finite.

// The pixel of x_cam. For z > 0 and models 0 to 16 it is ProjectRay(x / z,
// y / z) to the bit.
std::optional<Eigen::Vector2d> ProjectPoint(Intrinsics intrinsics,
                                            const Eigen::Vector3d& x_cam);

// ProjectPoint minus `pixel`; on a panorama by the shorter way round.
std::optional<Eigen::Vector2d> ProjectionError(Intrinsics intrinsics,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_cam);

// The row of an observation, linearised at x_hat, the present position of its
// point in the camera: the matrix E with (w; v) = E x_cam, such that
//
//   v / w = J (p - p_hat) + e,   e = ProjectionError at x_hat,
//
// in the coordinates p of ChartAt(x_hat), with J = d pixel / d p there. On
// z = 1, w = e3'x and v = (J (I2 | -u_hat) + e e3') x. It is exact at x_hat,
// and correct to first order around it; w > 0 on the chart's side of the
// camera. The length of x_hat does not matter. nullopt if the point does not
// project or J is not finite (at the poles of a panorama).
std::optional<Eigen::Matrix3d> RowAtProjection(Intrinsics intrinsics,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_hat);

// The unit vector whose projection is the pixel and that lies before the first
// fold of the model: det J > 0 from the axis to it. It generalises
// UndistortPixel to rays beyond 90 degrees and to panoramas. The search starts
// at `x_start`, if that is given and seen by the lens, and then as there. As
// the ray is defined without the start, the result does not depend on it: it is
// found from any start, the same one up to rounding. (An exception is possible
// only if the search from the axis fails. With 5,000 random, mostly strong
// cameras of every model and six starts each, it did in 2 of 510,000 trials,
// both of RAD_TAN_THIN_PRISM_FISHEYE beyond 90 degrees.)
std::optional<Eigen::Vector3d> PixelBearing(
    Intrinsics intrinsics, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>& x_start = {});

}  // namespace krot::internal
