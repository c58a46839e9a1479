#include "krot/camera/camera_model.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/camera/interval.h"
#include "krot/camera/models.h"
#include "krot/camera/undistort.h"

namespace krot::internal {
namespace {

// Name and parameters, in the order of the ids.
constexpr std::string_view kNames[][2] = {
    {"SIMPLE_PINHOLE", "f, cx, cy"},
    {"PINHOLE", "fx, fy, cx, cy"},
    {"SIMPLE_RADIAL", "f, cx, cy, k"},
    {"RADIAL", "f, cx, cy, k1, k2"},
    {"OPENCV", "fx, fy, cx, cy, k1, k2, p1, p2"},
    {"OPENCV_FISHEYE", "fx, fy, cx, cy, k1, k2, k3, k4"},
    {"FULL_OPENCV", "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6"},
    {"FOV", "fx, fy, cx, cy, omega"},
    {"SIMPLE_RADIAL_FISHEYE", "f, cx, cy, k"},
    {"RADIAL_FISHEYE", "f, cx, cy, k1, k2"},
    {"THIN_PRISM_FISHEYE", "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1"},
    {"RAD_TAN_THIN_PRISM_FISHEYE",
     "fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3"},
    {"SIMPLE_DIVISION", "f, cx, cy, k"},
    {"DIVISION", "fx, fy, cx, cy, k"},
    {"SIMPLE_FISHEYE", "f, cx, cy"},
    {"FISHEYE", "fx, fy, cx, cy"},
    {"EUCM", "fx, fy, cx, cy, alpha, beta"},
    {"EQUIRECTANGULAR", "w, h"},
};

std::vector<CameraModelInfo> ListCameraModels() {
  std::vector<CameraModelInfo> models;
  for (const auto& [name, param_names] : kNames) {
    const auto id = static_cast<int>(models.size());
    const int num_params = VisitEveryCameraModel(
        id, [](auto model) { return decltype(model)::kNumParams; });
    models.push_back(
        {id, name, param_names, num_params, id != Equirectangular::kId});
  }
  return models;
}

}  // namespace

const std::vector<CameraModelInfo>& CameraModels() {
  static const std::vector<CameraModelInfo> models = ListCameraModels();
  return models;
}

const CameraModelInfo* FindCameraModel(int id) {
  const std::vector<CameraModelInfo>& models = CameraModels();
  if (id < 0 || id >= static_cast<int>(models.size())) return nullptr;
  return &models[id];
}

const CameraModelInfo* FindCameraModel(std::string_view name) {
  const std::vector<CameraModelInfo>& models = CameraModels();
  const auto model = std::find_if(
      models.begin(), models.end(),
      [&](const CameraModelInfo& info) { return info.name == name; });
  return model == models.end() ? nullptr : &*model;
}

Eigen::Vector2d ProjectRay(Intrinsics intrinsics, const Eigen::Vector2d& u) {
  return VisitCameraModel(intrinsics.model_id, [&](auto model) {
    Eigen::Vector2d pixel;
    model.Project(intrinsics.params, u.x(), u.y(), &pixel.x(), &pixel.y());
    return pixel;
  });
}

Eigen::Matrix2d ProjectionJacobian(Intrinsics intrinsics,
                                   const Eigen::Vector2d& u) {
  return VisitCameraModel(intrinsics.model_id, [&](auto model) {
    return Differentiate(u,
                         [&](const auto& a, const auto& b, auto* x, auto* y) {
                           model.Project(intrinsics.params, a, b, x, y);
                         })
        .derivative;
  });
}

namespace {

template <typename Model>
constexpr bool kHasImagePlane = !std::is_void_v<typename Model::Lens>;

// Whether the chart of a unit vector with this z is the plane z = 1.
template <typename Lens>
bool HasChartOnImagePlane(double z) {
  if constexpr (std::is_same_v<Lens, DivisionLens>) {
    return z > 0.17364817766693033;  // the cosine of 80 degrees
  }
  return std::is_same_v<Lens, PerspectiveLens>;
}

}  // namespace

std::optional<UndistortedObservation> UndistortPixel(
    Intrinsics intrinsics, const Eigen::Vector2d& pixel) {
  return VisitEveryCameraModel(
      intrinsics.model_id,
      [&](auto model) -> std::optional<UndistortedObservation> {
        using Model = decltype(model);
        if constexpr (kHasImagePlane<Model>) {
          return Undistort<Model>(intrinsics.params, pixel);
        }
        return std::nullopt;
      });
}

std::optional<Chart> ChartAt(Intrinsics intrinsics,
                             const Eigen::Vector3d& x_cam) {
  if (!x_cam.allFinite() || x_cam.isZero(0)) return std::nullopt;
  const Eigen::Vector3d bearing = x_cam.stableNormalized();
  return VisitEveryCameraModel(
      intrinsics.model_id, [&](auto model) -> std::optional<Chart> {
        using Model = decltype(model);
        if (!Model::Sees(intrinsics.params, bearing.x(), bearing.y(),
                         bearing.z())) {
          return std::nullopt;
        }
        Chart chart;
        if (HasChartOnImagePlane<typename Model::Lens>(bearing.z())) {
          chart.n = Eigen::Vector3d::UnitZ();
          chart.B.setIdentity();
        } else {
          chart.n = bearing;
          chart.B.col(0) = bearing.unitOrthogonal();
          chart.B.col(1) = bearing.cross(chart.B.col(0));
        }
        return chart;
      });
}

Eigen::Matrix2d ChartJacobian(Intrinsics intrinsics, const Chart& chart,
                              const Eigen::Vector3d& x_cam) {
  const Eigen::Vector3d on_chart = x_cam / chart.n.dot(x_cam);
  return VisitEveryCameraModel(intrinsics.model_id, [&](auto model) {
    Dual<double> X[3], x, y;
    for (int i = 0; i < 3; ++i) {
      X[i] = {on_chart[i], chart.B(i, 0), chart.B(i, 1)};
    }
    decltype(model)::ProjectPoint(intrinsics.params, X[0], X[1], X[2], &x, &y);
    Eigen::Matrix2d J;
    J << x.du, x.dv, y.du, y.dv;
    return J;
  });
}

namespace {

std::optional<Eigen::Vector2d> IfFinite(const Eigen::Vector2d& v) {
  if (!v.allFinite()) return std::nullopt;
  return v;
}

template <typename Model>
Eigen::Vector2d Project(const double* params, const Eigen::Vector3d& x_cam) {
  Eigen::Vector2d pixel = Eigen::Vector2d::Constant(kNaN);
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

// RowAtProjection for points in front of a perspective lens, whose chart is
// z = 1; computes value and derivatives at once. Returns false for all others.
template <typename Model>
bool RowOnImagePlane(const double* params, const Eigen::Vector2d& pixel,
                     const Eigen::Vector3d& x_hat, Eigen::Matrix3d* E) {
  if constexpr (std::is_same_v<typename Model::Lens, PerspectiveLens>) {
    const Eigen::Vector2d u = x_hat.hnormalized();
    if (!(x_hat.z() > 0 && std::isfinite(u.squaredNorm()))) return false;
    Dual<double> x, y;
    Model::Project(params, Dual<double>{u.x(), 1, 0}, Dual<double>{u.y(), 0, 1},
                   &x, &y);
    E->row(0) << 0, 0, 1;
    E->row(1) << x.du, x.dv,
        x.value - pixel.x() - (x.du * u.x() + x.dv * u.y());
    E->row(2) << y.du, y.dv,
        y.value - pixel.y() - (y.du * u.x() + y.dv * u.y());
    return true;
  }
  return false;
}

// PixelBearing, of any length.
template <typename Model>
std::optional<Eigen::Vector3d> BearingOf(
    const double* params, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>& x_start) {
  using Lens = typename Model::Lens;
  if (!(Model::FocalX(params) * Model::FocalY(params) > 0)) return std::nullopt;
  const double* lens = Model::LensParams(params);
  std::optional<Eigen::Vector2d> q_start;
  if (x_start && Lens::Sees(lens, x_start->x(), x_start->y(), x_start->z())) {
    q_start.emplace();
    Lens::FromPoint(lens, x_start->x(), x_start->y(), x_start->z(),
                    &q_start->x(), &q_start->y());
  }
  std::optional<Eigen::Vector3d> bearing;
  SearchLensPlane<Model>(params, pixel, q_start, [&](const Eigen::Vector2d& q) {
    Eigen::Vector3d X;
    const bool reproduced =
        q.allFinite() &&
        Lens::ToPoint(lens, q.x(), q.y(), &X.x(), &X.y(), &X.z()) &&
        (Project<Model>(params, X) - pixel).norm() <= kMaxUndistortionErrorPx;
    if (reproduced) bearing = X;
    return reproduced;
  });
  return bearing;
}

template <>
std::optional<Eigen::Vector3d> BearingOf<Equirectangular>(
    const double* params, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>&) {
  const double azimuth = 2 * kPi * (pixel.x() / params[0] - 0.5);
  const double elevation = kPi * (pixel.y() / params[1] - 0.5);
  if (!(std::abs(elevation) <= kPi / 2 && std::isfinite(azimuth))) {
    return std::nullopt;
  }
  return Eigen::Vector3d(std::cos(elevation) * std::sin(azimuth),
                         std::sin(elevation),
                         std::cos(elevation) * std::cos(azimuth));
}

}  // namespace

std::optional<Eigen::Vector2d> ProjectPoint(Intrinsics intrinsics,
                                            const Eigen::Vector3d& x_cam) {
  return IfFinite(VisitEveryCameraModel(intrinsics.model_id, [&](auto model) {
    return Project<decltype(model)>(intrinsics.params, x_cam);
  }));
}

std::optional<Eigen::Vector2d> ProjectionError(Intrinsics intrinsics,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_cam) {
  std::optional<Eigen::Vector2d> error = ProjectPoint(intrinsics, x_cam);
  if (!error) return std::nullopt;
  *error -= pixel;
  if (intrinsics.model_id == Equirectangular::kId) {
    error->x() = std::remainder(error->x(), intrinsics.params[0]);
  }
  return IfFinite(*error);
}

std::optional<Eigen::Matrix3d> RowAtProjection(Intrinsics intrinsics,
                                               const Eigen::Vector2d& pixel,
                                               const Eigen::Vector3d& x_hat) {
  Eigen::Matrix3d E;
  if (VisitEveryCameraModel(intrinsics.model_id, [&](auto model) {
        return RowOnImagePlane<decltype(model)>(intrinsics.params, pixel, x_hat,
                                                &E);
      })) {
    return E.allFinite() ? std::optional(E) : std::nullopt;
  }
  const auto error = ProjectionError(intrinsics, pixel, x_hat);
  if (!error) return std::nullopt;
  const auto chart = ChartAt(intrinsics, x_hat);
  if (!chart) return std::nullopt;
  const Eigen::Vector3d on_chart = x_hat / chart->n.dot(x_hat);
  const Eigen::Matrix2d J = ChartJacobian(intrinsics, *chart, on_chart);
  const Eigen::Vector2d p_hat = chart->B.transpose() * on_chart;
  E.row(0) = chart->n.transpose();
  E.bottomRows<2>() =
      J * chart->B.transpose() + (*error - J * p_hat) * chart->n.transpose();
  if (!E.allFinite()) return std::nullopt;
  return E;
}

std::optional<Eigen::Vector3d> PixelBearing(
    Intrinsics intrinsics, const Eigen::Vector2d& pixel,
    const std::optional<Eigen::Vector3d>& x_start) {
  const auto X = VisitEveryCameraModel(intrinsics.model_id, [&](auto model) {
    return BearingOf<decltype(model)>(intrinsics.params, pixel, x_start);
  });
  if (!X || !X->allFinite()) return std::nullopt;
  return X->stableNormalized();
}

}  // namespace krot::internal
