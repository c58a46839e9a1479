#include "krot/camera/projection_row.h"
#include <Eigen/Geometry>
#include "krot/camera/camera_model.h"
namespace krot {
std::optional<Eigen::Vector2d> ProjectPoint(int model_id, const double* params, const Eigen::Vector3d& x_cam) {
  if (!(x_cam.z() > 0)) return std::nullopt;
  Eigen::Vector2d p = ProjectRay(model_id, params, x_cam.hnormalized());
  if (!p.allFinite()) return std::nullopt;
  return p;
}
Eigen::Vector2d PixelDifference(int, const double*, const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a - b; }
std::optional<Eigen::Matrix3d> RowAtProjection(int model_id, const double* params, const Eigen::Vector2d& pixel, const Eigen::Vector3d& x_cam) {
  const auto p = ProjectPoint(model_id, params, x_cam);
  if (!p) return std::nullopt;
  const Eigen::Vector2d u = x_cam.hnormalized();
  const Eigen::Matrix2d J = ProjectionJacobian(model_id, params, u);
  Eigen::Matrix3d E;
  E.row(0) << 0, 0, 1;
  E.bottomRows<2>() << J, *p - pixel - J * u;
  if (!E.allFinite()) return std::nullopt;
  return E;
}
bool IsPinhole(int model_id) { return model_id <= 1; }
}  // namespace krot
