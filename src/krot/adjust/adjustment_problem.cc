#include "krot/adjust/adjustment_problem.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include <ceres/manifold.h>
#include <ceres/product_manifold.h>

#include "krot/adjust/adjustment_columns.h"
#include "krot/adjust/reprojection_cost.h"
#include "krot/base/parallel_for.h"

namespace krot {
namespace {

using PoseManifold = ceres::ProductManifold<ceres::QuaternionManifold,
                                            ceres::EuclideanManifold<3>>;

// The gauge is free, so the normal equations are singular but for the damping,
// which is the diagonal of J'J divided by the radius: a larger one would leave
// it to rounding whether they are positive definite.
constexpr double kLargestTrustRegion = 1e8;

// Holds still the coordinates in `constant` of a block of `size`.
void HoldStill(double* block, int size, const std::vector<int>& constant,
               ceres::Problem* problem) {
  if (!problem->HasParameterBlock(block) || constant.empty()) return;
  if (static_cast<int>(constant.size()) == size) {
    problem->SetParameterBlockConstant(block);
  } else {
    problem->SetManifold(block, new ceres::SubsetManifold(size, constant));
  }
}

void ParameterizePose(bool is_refined, bool is_rotation_refined,
                      PoseBlock* pose, ceres::Problem* problem) {
  if (!problem->HasParameterBlock(pose->data())) return;
  if (!is_refined) {
    problem->SetParameterBlockConstant(pose->data());
  } else if (!is_rotation_refined) {
    problem->SetManifold(pose->data(),
                         new ceres::SubsetManifold(7, {0, 1, 2, 3}));
  } else {
    problem->SetManifold(pose->data(), new PoseManifold());
  }
}

}  // namespace

ceres::Problem::Options AdjustmentProblemOptions() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

void BuildAdjustmentProblem(const BundleAdjustmentOptions& options,
                            ceres::LossFunction* loss, AdjustmentBlocks* blocks,
                            ceres::Problem* problem) {
  for (const AdjustmentObservation& observation : blocks->observations) {
    std::vector<double*> parameters = {
        blocks->points[observation.point].data(),
        blocks->frames[observation.frame].data()};
    if (observation.sensor >= 0) {
      parameters.push_back(blocks->sensors[observation.sensor].data());
    }
    parameters.push_back(blocks->cameras[observation.camera].data());
    problem->AddResidualBlock(
        new ReprojectionCost(blocks->camera_models[observation.camera],
                             observation.sensor >= 0, observation.pixel),
        loss, parameters);
  }
  for (size_t f = 0; f < blocks->frames.size(); ++f) {
    ParameterizePose(
        options.refine_rig_from_world && !blocks->frame_is_fixed[f],
        !options.constant_rig_from_world_rotation, &blocks->frames[f], problem);
  }
  for (size_t s = 0; s < blocks->sensors.size(); ++s) {
    ParameterizePose(
        options.refine_sensor_from_rig && !blocks->sensor_is_fixed[s], true,
        &blocks->sensors[s], problem);
  }
  for (size_t c = 0; c < blocks->cameras.size(); ++c) {
    const std::vector<int> refined =
        RefinedParams(blocks->camera_models[c], options);
    std::vector<int> constant;
    const auto size = static_cast<int>(blocks->cameras[c].size());
    for (int i = 0; i < size; ++i) {
      if (std::find(refined.begin(), refined.end(), i) == refined.end()) {
        constant.push_back(i);
      }
    }
    HoldStill(blocks->cameras[c].data(), size, constant, problem);
  }
  for (size_t k = 0; k < blocks->points.size(); ++k) {
    if (options.refine_points3D && !blocks->point_is_fixed[k]) continue;
    HoldStill(blocks->points[k].data(), 3, {0, 1, 2}, problem);
  }
}

ceres::Solver::Options AdjustmentSolverOptions(
    const BundleAdjustmentOptions& options, const Context& context,
    AdjustmentBlocks* blocks, const ceres::Problem& problem) {
  ceres::Solver::Options solver;
  solver.logging_type = ceres::SILENT;
  solver.max_num_iterations = options.max_num_iterations;
  solver.max_linear_solver_iterations = options.max_linear_solver_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.gradient_tolerance = options.gradient_tolerance;
  solver.parameter_tolerance = options.parameter_tolerance;
  solver.max_num_consecutive_invalid_steps = 10;
  solver.max_trust_region_radius = kLargestTrustRegion;
  solver.num_threads = ResolveNumThreads(context.num_threads);
  if (!options.refine_points3D) {
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    return solver;
  }

  if (blocks->num_images <= options.max_num_images_direct_dense) {
    solver.linear_solver_type = ceres::DENSE_SCHUR;
  } else if (blocks->num_images <= options.max_num_images_direct_sparse) {
    solver.linear_solver_type = ceres::SPARSE_SCHUR;
  } else {
    solver.linear_solver_type = ceres::ITERATIVE_SCHUR;
    solver.preconditioner_type = ceres::SCHUR_JACOBI;
  }
  // One group per camera: within a group Ceres goes by addresses, which for
  // blocks of separate vectors differ from run to run.
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  const auto add = [&](double* block, int group) {
    if (problem.HasParameterBlock(block)) {
      ordering->AddElementToGroup(block, group);
    }
  };
  for (Eigen::Vector3d& point : blocks->points) add(point.data(), 0);
  for (PoseBlock& frame : blocks->frames) add(frame.data(), 1);
  for (PoseBlock& sensor : blocks->sensors) add(sensor.data(), 2);
  int group = 3;
  for (std::vector<double>& camera : blocks->cameras) {
    add(camera.data(), group++);
  }
  solver.linear_solver_ordering = std::move(ordering);
  return solver;
}

}  // namespace krot
