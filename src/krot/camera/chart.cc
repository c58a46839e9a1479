#include "krot/camera/chart.h"

#include <cmath>

#include <Eigen/Geometry>

#include "krot/camera/dual.h"
#include "krot/camera/models.h"

namespace krot::internal {
namespace {

constexpr double kCosOf80Degrees = 0.17364817766693033;

// Whether a direction of length 1 has its chart on z = 1.
bool IsOnImagePlane(PerspectiveLens, double) { return true; }
bool IsOnImagePlane(DivisionLens, double z) { return z > kCosOf80Degrees; }
template <typename Lens>
bool IsOnImagePlane(Lens, double) {
  return false;
}

template <typename Model>
bool HasChartOnImagePlane(const Eigen::Vector3d& bearing) {
  return IsOnImagePlane(typename Model::Lens{}, bearing.z());
}
template <>
bool HasChartOnImagePlane<Equirectangular>(const Eigen::Vector3d&) {
  return false;
}

}  // namespace

std::optional<Chart> ChartAt(int model_id, const double* params,
                             const Eigen::Vector3d& x_cam) {
  if (!x_cam.allFinite() || x_cam.isZero(0)) return std::nullopt;
  const Eigen::Vector3d bearing = x_cam.stableNormalized();
  return VisitEveryCameraModel(
      model_id, [&](auto model) -> std::optional<Chart> {
        using Model = decltype(model);
        if (!Model::Sees(params, bearing.x(), bearing.y(), bearing.z())) {
          return std::nullopt;
        }
        Chart chart;
        if (HasChartOnImagePlane<Model>(bearing)) {
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

Eigen::Matrix2d ChartJacobian(int model_id, const double* params,
                              const Chart& chart,
                              const Eigen::Vector3d& x_cam) {
  const Eigen::Vector3d on_chart = x_cam / chart.n.dot(x_cam);
  return VisitEveryCameraModel(model_id, [&](auto model) {
    Dual<double> X[3], x, y;
    for (int i = 0; i < 3; ++i) {
      X[i] = {on_chart[i], chart.B(i, 0), chart.B(i, 1)};
    }
    decltype(model)::ProjectPoint(params, X[0], X[1], X[2], &x, &y);
    Eigen::Matrix2d J;
    J << x.du, x.dv, y.du, y.dv;
    return J;
  });
}

}  // namespace krot::internal
