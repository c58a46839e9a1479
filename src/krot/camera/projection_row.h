#pragma once

#include <optional>

#include <Eigen/Core>

namespace krot::internal {

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
// (camera_model.h) beyond 90 degrees and for panoramas: the same search from
// the same starts, `x_start` first.
std::optional<Eigen::Vector3d> PixelBearing(
    int model_id, const double* params, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>& x_start = {});

}  // namespace krot::internal
