#include "krot/camera/projection_row.h"

#include <cmath>
#include <limits>
#include <type_traits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/camera/chart.h"
#include "krot/camera/dual.h"
#include "krot/camera/models.h"
#include "krot/camera/undistort.h"

namespace krot::internal {
namespace {

template <typename Model>
constexpr bool kHasImagePlane = !std::is_same_v<Model, Equirectangular>;

std::optional<Eigen::Vector2d> IfFinite(const Eigen::Vector2d& v) {
  if (!v.allFinite()) return std::nullopt;
  return v;
}

template <typename Model>
Eigen::Vector2d Project(const double* params, const Eigen::Vector3d& x_cam) {
  Eigen::Vector2d pixel =
      Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (!x_cam.allFinite() || x_cam.isZero(0)) return pixel;
  if constexpr (kHasImagePlane<Model>) {
    const Eigen::Vector2d u = x_cam.hnormalized();
    if (x_cam.z() > 0 && std::isfinite(u.squaredNorm())) {
      Model::Project(params, u.x(), u.y(), &pixel.x(), &pixel.y());
      return pixel;
    }
  }
  const Eigen::Vector3d n = x_cam.stableNormalized();
  if (!Model::Sees(params, n.x(), n.y(), n.z())) return pixel;
  Model::ProjectPoint(params, n.x(), n.y(), n.z(), &pixel.x(), &pixel.y());
  return pixel;
}

// RowAtProjection in front of a perspective lens, whose chart is z = 1: value
// and derivatives in one go. False, and no E, everywhere else.
template <typename Model>
bool RowOnImagePlane(const double* params, const Eigen::Vector2d& pixel,
                     const Eigen::Vector3d& x_hat, Eigen::Matrix3d* E) {
  if constexpr (kHasImagePlane<Model>) {
    if constexpr (std::is_same_v<typename Model::Lens, PerspectiveLens>) {
      const Eigen::Vector2d u = x_hat.hnormalized();
      if (!(x_hat.z() > 0 && std::isfinite(u.squaredNorm()))) return false;
      Dual<double> x, y;
      Model::Project(params, Dual<double>{u.x(), 1, 0},
                     Dual<double>{u.y(), 0, 1}, &x, &y);
      E->row(0) << 0, 0, 1;
      E->row(1) << x.du, x.dv,
          x.value - pixel.x() - (x.du * u.x() + x.dv * u.y());
      E->row(2) << y.du, y.dv,
          y.value - pixel.y() - (y.du * u.x() + y.dv * u.y());
      return true;
    }
  }
  return false;
}

template <typename Model>
Eigen::Vector3d BearingOf(const double* params, const Eigen::Vector2d& pixel,
                          const std::optional<Eigen::Vector3d>& x_start,
                          bool* found) {
  using Lens = typename Model::Lens;
  const double* lens = Model::LensParams(params);
  Eigen::Vector3d X;
  const auto accept = [&](const Eigen::Vector2d& q) {
    const bool reproduced =
        q.allFinite() &&
        Lens::ToPoint(lens, q.x(), q.y(), &X.x(), &X.y(), &X.z()) &&
        (Project<Model>(params, X) - pixel).norm() <= kMaxUndistortionErrorPx;
    return reproduced ? UndistortStatus::kOk : UndistortStatus::kNotConverged;
  };
  std::optional<Eigen::Vector2d> q_start;
  if (x_start && Lens::Sees(lens, x_start->x(), x_start->y(), x_start->z())) {
    q_start.emplace();
    Lens::FromPoint(lens, x_start->x(), x_start->y(), x_start->z(),
                    &q_start->x(), &q_start->y());
  }
  *found = Model::FocalX(params) * Model::FocalY(params) > 0 &&
           SearchLensPlane<Model>(params, pixel, q_start, accept) ==
               UndistortStatus::kOk;
  return X;
}

template <>
Eigen::Vector3d BearingOf<Equirectangular>(
    const double* params, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>&, bool* found) {
  const double azimuth = 2 * kPi * (pixel.x() / params[0] - 0.5);
  const double elevation = kPi * (pixel.y() / params[1] - 0.5);
  *found = std::abs(elevation) <= kHalfPi && std::isfinite(azimuth);
  return {std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
          std::cos(elevation) * std::cos(azimuth)};
}

}  // namespace

std::optional<Eigen::Vector2d> ProjectPoint(int model_id, const double* params,
                                            const Eigen::Vector3d& x_cam) {
  return IfFinite(VisitEveryCameraModel(model_id, [&](auto model) {
    return Project<decltype(model)>(params, x_cam);
  }));
}

std::optional<Eigen::Vector2d> ProjectionError(int model_id,
                                               const double* params,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_cam) {
  std::optional<Eigen::Vector2d> error = ProjectPoint(model_id, params, x_cam);
  if (!error) return std::nullopt;
  *error -= pixel;
  if (model_id == Equirectangular::kId) {
    error->x() = std::remainder(error->x(), params[0]);
  }
  return IfFinite(*error);
}

std::optional<Eigen::Matrix3d> RowAtProjection(int model_id,
                                               const double* params,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_hat) {
  Eigen::Matrix3d E;
  if (VisitEveryCameraModel(model_id, [&](auto model) {
        return RowOnImagePlane<decltype(model)>(params, pixel, x_hat, &E);
      })) {
    return E.allFinite() ? std::optional(E) : std::nullopt;
  }
  const auto error = ProjectionError(model_id, params, pixel, x_hat);
  if (!error) return std::nullopt;
  const auto chart = ChartAt(model_id, params, x_hat);
  if (!chart) return std::nullopt;
  const Eigen::Vector3d on_chart = x_hat / chart->n.dot(x_hat);
  const Eigen::Matrix2d J = ChartJacobian(model_id, params, *chart, on_chart);
  const Eigen::Vector2d p_hat = chart->B.transpose() * on_chart;
  E.row(0) = chart->n.transpose();
  E.bottomRows<2>() =
      J * chart->B.transpose() + (*error - J * p_hat) * chart->n.transpose();
  if (!E.allFinite()) return std::nullopt;
  return E;
}

std::optional<Eigen::Vector3d> PixelBearing(
    int model_id, const double* params, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>& x_start) {
  bool found = false;
  const Eigen::Vector3d X = VisitEveryCameraModel(model_id, [&](auto model) {
    return BearingOf<decltype(model)>(params, pixel, x_start, &found);
  });
  if (!found || !X.allFinite()) return std::nullopt;
  return X.stableNormalized();
}

}  // namespace krot::internal
