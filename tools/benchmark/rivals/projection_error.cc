#include "tools/benchmark/rivals/projection_error.h"

#include <memory>

#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

constexpr int kMaxDenseFrames = 50;

// The error of one observation as a function of its translation and point.
class ProjectionError : public ceres::SizedCostFunction<2, 3, 3> {
 public:
  ProjectionError(const View& view, const Observation& observation,
                  const Vector2d* target)
      : view_(view), observation_(observation), target_(target) {}

  // Returns false if the point is behind the camera.
  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Vector3d> t(parameters[0]);
    const Eigen::Map<const Vector3d> s(parameters[1]);
    const Vector3d x_cam = view_.cam_from_world_rotation * s +
                           view_.cam_from_rig_rotation * t +
                           view_.cam_from_rig_translation;
    const auto depth = observation_.E.row(0);
    const double w = depth * x_cam;
    if (!(w > 0)) return false;
    const RowMajor23 E = observation_.E.bottomRows<2>();
    const Vector2d r = E * x_cam / w;
    Eigen::Map<Vector2d> result(residuals);
    result = r;
    if (target_ != nullptr) result -= *target_;
    if (jacobians == nullptr) return true;
    const RowMajor23 by_x_cam = (E - r * depth) / w;
    if (jacobians[0] != nullptr) {
      Eigen::Map<RowMajor23> J(jacobians[0]);
      J = by_x_cam * view_.cam_from_rig_rotation;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<RowMajor23> J(jacobians[1]);
      J = by_x_cam * view_.cam_from_world_rotation;
    }
    return true;
  }

 private:
  const View& view_;
  const Observation& observation_;
  const Vector2d* target_;  // null: zero
};

}  // namespace

void BuildLeastSquares(const KnownRotationProblem& problem,
                       const std::vector<Vector2d>* targets, Estimate* estimate,
                       ceres::Problem* least_squares) {
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    least_squares->AddResidualBlock(
        new ProjectionError(view, observation,
                            targets == nullptr ? nullptr : &(*targets)[i]),
        nullptr, estimate->translations[view.frame].data(),
        estimate->points[observation.point].data());
  }
  least_squares->SetParameterBlockConstant(estimate->translations[0].data());
}

ceres::Solver::Options LeastSquaresOptions(const KnownRotationProblem& problem,
                                           int num_threads,
                                           Estimate* estimate) {
  ceres::Solver::Options options;
  options.num_threads = num_threads;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = problem.num_frames <= kMaxDenseFrames
                                   ? ceres::DENSE_SCHUR
                                   : ceres::SPARSE_SCHUR;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (int32_t k = 0; k < problem.num_points; ++k) {
    ordering->AddElementToGroup(estimate->points[k].data(), 0);
  }
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    ordering->AddElementToGroup(estimate->translations[f].data(), 1);
  }
  options.linear_solver_ordering = ordering;
  return options;
}

}  // namespace krot::internal
