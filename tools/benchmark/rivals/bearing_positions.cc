#include "tools/benchmark/rivals/bearing_positions.h"

#include <ceres/ceres.h>

#include <memory>
#include <random>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr double kCube = 100;
constexpr double kSmallestScale = 1e-5;
constexpr double kHuber = 0.1;
constexpr double kFunctionTolerance = 1e-5;

struct BearingError {
  template <typename T>
  bool operator()(const T* centre, const T* point, const T* scale,
                  T* residuals) const {
    for (int k = 0; k < 3; ++k) {
      residuals[k] = bearing[k] - scale[0] * (point[k] - centre[k]);
    }
    return true;
  }
  Vector3d bearing;
};

// The bearing in the world, of unit length.
Vector3d BearingOf(const View& view, const Observation& o) {
  Vector3d ray = o.E.row(1).cross(o.E.row(2)).transpose();
  if (o.E.row(0).dot(ray) < 0) ray = -ray;
  return (view.cam_from_world_rotation.transpose() * ray).normalized();
}

// Sets an elimination order: first scales, then points.
void Order(const std::vector<double*>& centres,
           const std::vector<double*>& points,
           const std::vector<double*>& scales,
           ceres::Solver::Options* options) {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (double* scale : scales) ordering->AddElementToGroup(scale, 0);
  for (double* point : points) ordering->AddElementToGroup(point, 1);
  for (double* centre : centres) ordering->AddElementToGroup(centre, 2);
  options->linear_solver_ordering = ordering;
}

}  // namespace

Estimate PositionByBearings(const KnownRotationProblem& problem,
                            const BearingPositionsOptions& options) {
  CheckArgument(!HasBaseline(problem), "problem", "a rig with baselines",
                "without");
  std::mt19937_64 random(options.random_seed);
  std::uniform_real_distribution<double> in_cube(-kCube, kCube);
  const auto random_place = [&] {
    const double x = in_cube(random);
    const double y = in_cube(random);
    return Vector3d(x, y, in_cube(random));
  };
  std::vector<Vector3d> centres(problem.num_frames);
  for (Vector3d& centre : centres) centre = random_place();
  Estimate estimate;
  estimate.translations.resize(problem.num_frames);
  for (int32_t k = 0; k < problem.num_points; ++k) {
    estimate.points.push_back(random_place());
  }
  std::vector<double> scales(problem.observations.size(), 1);

  ceres::Problem least_squares;
  std::vector<double*> centre_blocks, point_blocks, scale_blocks;
  for (size_t i = 0; i < scales.size(); ++i) {
    const Observation& o = problem.observations[i];
    const View& view = problem.views[o.view];
    least_squares.AddResidualBlock(
        new ceres::AutoDiffCostFunction<BearingError, 3, 3, 3, 1>(
            new BearingError{BearingOf(view, o)}),
        new ceres::HuberLoss(kHuber), centres[view.frame].data(),
        estimate.points[o.point].data(), &scales[i]);
    least_squares.SetParameterLowerBound(&scales[i], 0, kSmallestScale);
    scale_blocks.push_back(&scales[i]);
  }
  for (Vector3d& centre : centres) {
    if (least_squares.HasParameterBlock(centre.data())) {
      centre_blocks.push_back(centre.data());
    }
  }
  for (Vector3d& point : estimate.points) point_blocks.push_back(point.data());
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_SCHUR;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = kFunctionTolerance;
  solver.num_threads = ResolveNumThreads(options.num_threads);
  solver.logging_type = ceres::SILENT;
  Order(centre_blocks, point_blocks, scale_blocks, &solver);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &least_squares, &summary);
  for (const View& view : problem.views) {
    const Eigen::Matrix3d rig_from_world_rotation =
        view.cam_from_rig_rotation.transpose() * view.cam_from_world_rotation;
    estimate.translations[view.frame] =
        -rig_from_world_rotation * centres[view.frame];
  }
  return estimate;
}

}  // namespace krot::internal
