#include "krot/camera/remainder_bound.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/LU>

#include "krot/base/check.h"
#include "krot/camera/chart.h"
#include "krot/camera/error_map.h"
#include "krot/camera/models.h"
#include "krot/camera/projection_row.h"
#include "krot/camera/remainder_search.h"

namespace krot {
namespace {

// Half the sides of the parallelogram in level_px of the linearised lens; the
// first whose boundary holds no |f| <= gamma is taken.
constexpr std::array<double, 4> kReaches = {1.125, 1.5, 2.5, 4};

// The pixel's ray may be this far from x_hat in the latter's chart.
constexpr double kSmallestDepth = 0.1;

}  // namespace

std::optional<double> RemainderBound(int model_id, const double* params,
                                     const Eigen::Vector2d& pixel,
                                     const Eigen::Vector3d& x_hat,
                                     double level_px, double p) {
  CheckArgument(level_px > 0, "level_px", level_px, "> 0");
  CheckArgument(p == 1 || p == 2 || std::isinf(p), "p", p, "1, 2 or infinity");
  const auto E = RowAtProjection(model_id, params, pixel, x_hat);
  if (!E) return std::nullopt;
  if (model_id == SimplePinhole::kId || model_id == Pinhole::kId) return 0;

  const auto bearing = PixelBearing(model_id, params, pixel, x_hat);
  const auto chart = ChartAt(model_id, params, x_hat);
  if (!bearing || !chart) return std::nullopt;
  const double depth = chart->n.dot(*bearing);
  if (!(depth > kSmallestDepth * bearing->norm())) return std::nullopt;
  const Eigen::Vector3d X0 = *bearing / depth;
  const Eigen::Matrix2d J0 = ChartJacobian(model_id, params, *chart, X0);
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
  const auto map = MakeErrorMap(model_id, params, geometry);

  for (const double reach : kReaches) {
    if (!BoundaryIsOutside(*map, p, reach)) continue;
    if (const auto largest = LargestLinearError(*map, p, reach)) {
      return std::max(0.0, *largest - 1);
    }
    return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace krot
