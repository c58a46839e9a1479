#include "krot/camera/remainder_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include <Eigen/LU>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/interval.h"
#include "krot/camera/models.h"
#include "krot/geometry.h"

namespace krot::internal {
namespace {

template <typename T>
T Dot(const Eigen::RowVector3d& row, const T (&x)[3]) {
  return x[0] * row[0] + x[1] * row[1] + x[2] * row[2];
}

template <typename Model>
class ModelErrorMap : public ErrorMap {
 public:
  ModelErrorMap(const double* params, const Geometry& geometry)
      : geometry_(geometry) {
    for (int i = 0; i < Model::kNumParams; ++i) {
      params_[i] = {params[i], params[i]};
    }
  }

  ErrorPair<Interval> Values(const Interval& q1,
                             const Interval& q2) const override {
    return Evaluate(q1, q2);
  }

  ErrorPair<Dual<Interval>> Derivatives(const Interval& q1,
                                        const Interval& q2) const override {
    const Interval one = {1, 1};
    const Interval zero = {0, 0};
    return Evaluate(Dual<Interval>{q1, one, zero},
                    Dual<Interval>{q2, zero, one});
  }

 private:
  template <typename T>
  ErrorPair<T> Evaluate(const T& q1, const T& q2) const {
    const Geometry& g = geometry_;
    T X[3];
    for (int i = 0; i < 3; ++i) {
      X[i] = q1 * g.G(i, 0) + q2 * g.G(i, 1) + g.X0[i];
    }
    ErrorPair<T> pair;
    EvaluateError(X, &pair.f[0], &pair.f[1]);
    const T w = Dot(g.E.row(0), X) * g.level_px;
    for (int i = 0; i < 2; ++i) {
      pair.f[i] = pair.f[i] / g.level_px;
      pair.m[i] = Dot(g.E.row(i + 1), X) / w;
    }
    return pair;
  }

  template <typename T>
  void EvaluateError(const T (&X)[3], T* x, T* y) const {
    const Eigen::Vector2d& pixel = geometry_.pixel;
    if constexpr (Model::kId != Equirectangular::kId) {
      if (geometry_.on_image_plane) {
        Model::Project(params_.data(), X[0], X[1], x, y);
        *x = *x - pixel.x();
        *y = *y - pixel.y();
        return;
      }
    }
    Model::ErrorAt(params_.data(), pixel.x(), pixel.y(), X[0], X[1], X[2], x,
                   y);
  }

  Geometry geometry_;
  std::array<Interval, Model::kNumParams> params_;
};

}  // namespace

std::unique_ptr<ErrorMap> MakeErrorMap(Intrinsics intrinsics,
                                       const ErrorMap::Geometry& geometry) {
  return VisitEveryCameraModel(
      intrinsics.model_id, [&](auto model) -> std::unique_ptr<ErrorMap> {
        return std::make_unique<ModelErrorMap<decltype(model)>>(
            intrinsics.params, geometry);
      });
}

namespace {

// More than the relative error of a few operations on doubles.
constexpr double kRounding = 1e-14;

bool IsPinhole(int model_id) {
  return model_id == SimplePinhole::kId || model_id == Pinhole::kId;
}

void CheckArguments(double level_px, double p) {
  CheckArgument(level_px > 0, "level_px", level_px, "> 0");
  CheckArgument(p == 1 || p == 2 || std::isinf(p), "p", p, "1, 2 or infinity");
}

struct Region {
  std::unique_ptr<ErrorMap> map;
  double reach = 0;
};

// Finds U of remainder_bound.h.
std::optional<Region> FindRegion(Intrinsics intrinsics,
                                 const Eigen::Vector2d& pixel,
                                 const Eigen::Vector3d& x_hat, double level_px,
                                 double p) {
  const auto E = RowAtProjection(intrinsics, pixel, x_hat);
  const auto bearing = PixelBearing(intrinsics, pixel, x_hat);
  const auto chart = ChartAt(intrinsics, x_hat);
  if (!E || !bearing || !chart) return std::nullopt;
  // The pixel's ray must not be too far from x_hat.
  const double depth = chart->n.dot(*bearing);
  if (!(depth > 0.1 * bearing->norm())) return std::nullopt;
  const Eigen::Vector3d X0 = *bearing / depth;
  const Eigen::Matrix2d J0 = ChartJacobian(intrinsics, *chart, X0);
  if (!(J0.determinant() > 0)) return std::nullopt;

  ErrorMap::Geometry geometry;
  geometry.pixel = pixel;
  geometry.E = *E;
  geometry.X0 = X0;
  geometry.G = level_px * chart->B * J0.inverse();
  geometry.on_image_plane = chart->n == Eigen::Vector3d::UnitZ() &&
                            chart->B.isIdentity(0) && X0.z() == 1;
  geometry.level_px = level_px;
  if (!geometry.G.allFinite()) return std::nullopt;
  Region region;
  region.map = MakeErrorMap(intrinsics, geometry);
  // Half the sides of the parallelogram, in units of level_px of the linearised
  // lens. The first one is taken with |f| > gamma on the whole boundary.
  for (const double reach : {1.125, 1.5, 2.5, 4.0}) {
    if (!BoundaryIsOutside(*region.map, p, reach)) continue;
    region.reach = reach;
    return region;
  }
  return std::nullopt;
}

}  // namespace

std::optional<double> RemainderBound(Intrinsics intrinsics,
                                     const Eigen::Vector2d& pixel,
                                     const Eigen::Vector3d& x_hat,
                                     double level_px, double p,
                                     double sufficient) {
  CheckArguments(level_px, p);
  if (IsPinhole(intrinsics.model_id)) {
    if (!RowAtProjection(intrinsics, pixel, x_hat)) return std::nullopt;
    return 0;
  }
  const auto region = FindRegion(intrinsics, pixel, x_hat, level_px, p);
  if (!region) return std::nullopt;
  const auto largest =
      LargestLinearError(*region->map, p, region->reach, 1 + sufficient);
  if (!largest) return std::nullopt;
  return std::max(0.0, *largest - 1);
}

std::optional<double> SupportBound(Intrinsics intrinsics,
                                   const Eigen::Vector2d& pixel,
                                   const Eigen::Vector3d& x_hat,
                                   const Eigen::Vector2d& y, double level_px,
                                   double p, double sufficient) {
  CheckArguments(level_px, p);
  const double length = DualNorm(y, {p}) * (1 + kRounding);
  if (!(length > 0))
    return length == 0 ? std::optional<double>(0) : std::nullopt;
  if (IsPinhole(intrinsics.model_id)) {
    if (!RowAtProjection(intrinsics, pixel, x_hat)) return std::nullopt;
    // The linear error is the true one except for the rounding of the row,
    // which is proportional to the terms whose difference the row is.
    const Eigen::Vector2d centre =
        intrinsics.model_id == SimplePinhole::kId
            ? Eigen::Vector2d(intrinsics.params[1], intrinsics.params[2])
            : Eigen::Vector2d(intrinsics.params[2], intrinsics.params[3]);
    const double terms = pixel.lpNorm<1>() + centre.lpNorm<1>() + 2 * level_px;
    return length * (level_px + 2 * kRounding * terms);
  }
  const auto region = FindRegion(intrinsics, pixel, x_hat, level_px, p);
  if (!region) return std::nullopt;
  const double unit = length * level_px * (1 + kRounding);
  const auto largest = LargestAlong(*region->map, p, region->reach, y / length,
                                    sufficient / unit * (1 - kRounding));
  if (!largest) return std::nullopt;
  return std::max(0.0, *largest) * unit;
}

}  // namespace krot::internal
