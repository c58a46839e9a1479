#include "krot/bridge/retriangulate.h"

#include <Eigen/Eigenvalues>

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The least eigenvalue of mean(I - d d') is half the mean squared sine
// between the rays and their mean direction, or so. Below this (angles of
// 1e-6) it is the rounding of rotations.
constexpr double kParallel = 1e-12;

}  // namespace

std::optional<Vector3d> RetriangulateMidpoint(const std::vector<Ray>& rays) {
  if (rays.empty()) return std::nullopt;
  // Relative to the mean centre, where rounding is least.
  Vector3d mean_centre = Vector3d::Zero();
  for (const Ray& ray : rays) mean_centre += ray.centre;
  mean_centre /= static_cast<double>(rays.size());

  Matrix3d normal_matrix = Matrix3d::Zero();
  Vector3d right_hand_side = Vector3d::Zero();
  for (const Ray& ray : rays) {
    const Matrix3d across =
        Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    normal_matrix += across;
    right_hand_side += across * (ray.centre - mean_centre);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(normal_matrix);
  const Vector3d& eigenvalues = solver.eigenvalues();
  if (!(eigenvalues[0] > kParallel * static_cast<double>(rays.size()))) {
    return std::nullopt;
  }
  const Matrix3d& axes = solver.eigenvectors();
  return mean_centre +
         axes * (axes.transpose() * right_hand_side).cwiseQuotient(eigenvalues);
}

}  // namespace krot
