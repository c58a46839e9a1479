#pragma once
#include <optional>
#include <Eigen/Core>
namespace krot {
std::optional<Eigen::Vector2d> ProjectPoint(int model_id, const double* params, const Eigen::Vector3d& x_cam);
Eigen::Vector2d PixelDifference(int model_id, const double* params, const Eigen::Vector2d& a, const Eigen::Vector2d& b);
std::optional<Eigen::Matrix3d> RowAtProjection(int model_id, const double* params, const Eigen::Vector2d& pixel, const Eigen::Vector3d& x_cam);
bool IsPinhole(int model_id);
}
