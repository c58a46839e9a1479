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
                  // to the ray, or none was found
  kOffAxis        // that ray is 90 degrees or more off the axis
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

// A plane n'X = 1 on which the rays of a camera near one of them have two
// coordinates: X(p) = n + B p, with B'B = I, B'n = 0, |n| = 1.
struct Chart {
  Eigen::Vector3d n;
  Eigen::Matrix<double, 3, 2> B;
};

// The chart in which an observation whose point lies in direction x_cam is
// linearised, a function of the model and of that direction alone:
//
//   perspective lens             z = 1, B = (e1, e2): the lens deforms that
//   (ids 0 to 4, 6)              plane, and where it does not the projection is
//                                linear there;
//   division model (12, 13)      the same up to 80 degrees off the axis;
//   every other, and beyond      the plane tangent to the unit sphere at
//                                x_cam / |x_cam|.
//
// A fisheye is far straighter in the tangent plane than on z = 1: 60 degrees
// off the axis, an equidistant lens has on z = 1 the radial curvature
// 2 tan(60) / f px^-1, in the tangent plane none.
//
// nullopt where the point does not project: x_cam zero or not finite, behind a
// perspective camera, out of the sight of its lens (lens.h).
std::optional<Chart> ChartAt(int model_id, const double* params,
                             const Eigen::Vector3d& x_cam);

// d pixel / d p at the ray of x_cam, 2x2.
Eigen::Matrix2d ChartJacobian(int model_id, const double* params,
                              const Chart& chart, const Eigen::Vector3d& x_cam);

// The projection of points in the camera's frame, for every model, and its
// first order: what an observation is to the solver.
//
// A point projects if its direction is in the sight of its lens: z > 0 for
// perspective lenses, all directions but a few for fisheyes (lens.h), all for
// EQUIRECTANGULAR. COLMAP itself stops its fisheyes, FOV and EUCM at
// 90 degrees; beyond, the same formulas of the angle go on. The functions below
// answer nullopt for a point that does not project, is zero or not finite, and
// throw std::invalid_argument for an unknown model.

// The pixel of x_cam. For z > 0 and models 0 to 16 it is ProjectRay(x / z,
// y / z) to the bit.
std::optional<Eigen::Vector2d> ProjectPoint(int model_id, const double* params,
                                            const Eigen::Vector3d& x_cam);

// That pixel less `pixel`; on a panorama the shorter way round.
std::optional<Eigen::Vector2d> ProjectionError(int model_id,
                                               const double* params,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_cam);

// The observation linearised at x_hat, the point as its camera sees it now: the
// matrix E with (w; v) = E x_cam, such that
//
//   v / w = J (p - p_hat) + e,   e = ProjectionError at x_hat,
//
// in the coordinates p of ChartAt(x_hat), J = d pixel / d p there; on z = 1,
// w = e3'x and v = (J (I2 | -u_hat) + e e3') x. Exact at x_hat, of first order
// around it; w > 0 on the chart's side of the camera. The length of x_hat does
// not matter. nullopt also where J is not finite (the poles of a panorama).
std::optional<Eigen::Matrix3d> RowAtProjection(int model_id,
                                               const double* params,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_hat);

// The unit vector whose projection is the pixel and that lies before the first
// fold of the model: det J > 0 from the axis to it. UndistortPixel
// beyond 90 degrees and for panoramas: the same search from
// the same starts, `x_start` first.
std::optional<Eigen::Vector3d> PixelBearing(
    int model_id, const double* params, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>& x_start = {});

}  // namespace krot::internal
