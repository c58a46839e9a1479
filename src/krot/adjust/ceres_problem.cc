#include "krot/adjust/ceres_problem.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include <ceres/crs_matrix.h>
#include <ceres/manifold.h>
#include <ceres/product_manifold.h>
#include <Eigen/Geometry>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry.h"
#include "krot/geometry/transform.h"
#include "krot/linear/blocks.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

using Matrix23 = Eigen::Matrix<double, 2, 3>;

// The order of a residual's parameter blocks; the camera is last.
enum { kPoint, kFrame, kSensor };

// x -> R(q) x + t for a block qw qx qy qz tx ty tz of unit quaternion, with
//   R(q) x = x + 2 w (v x x) + 2 v x (v x x),  q = (w, v).
struct BlockTransform : RigidTransform {
  explicit BlockTransform(const double* block)
      : RigidTransform{Eigen::Quaterniond(block[0], block[1], block[2],
                                          block[3])
                           .toRotationMatrix(),
                       {block[4], block[5], block[6]}},
        w(block[0]),
        v(block[1], block[2], block[3]) {}

  // d (R(q) x + t) / d block.
  Eigen::Matrix<double, 3, 7> BlockJacobian(const Vector3d& x) const {
    const Vector3d v_x = v.cross(x);
    Eigen::Matrix<double, 3, 7> jacobian;
    jacobian.col(0) = 2 * v_x;
    jacobian.middleCols<3>(1) = -2 * (w * CrossMatrix(x) + CrossMatrix(v_x) +
                                      CrossMatrix(v) * CrossMatrix(x));
    jacobian.rightCols<3>().setIdentity();
    return jacobian;
  }

  double w;
  Vector3d v;
};

// Writes a Jacobian if Ceres asks for it, that is if `to` is not null.
template <int kCols>
void StoreJacobian(const Eigen::Matrix<double, 2, kCols>& jacobian,
                   double* to) {
  if (to == nullptr) return;
  Eigen::Map<Eigen::Matrix<double, 2, kCols, Eigen::RowMajor>> block(to);
  block = jacobian;
}

using PoseManifold = ceres::ProductManifold<ceres::QuaternionManifold,
                                            ceres::EuclideanManifold<3>>;

// Makes the coordinates in `constant` of a block of `size` constant.
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

// How to solve the reduced camera system. A hundred iterations of conjugate
// gradients multiply an observation's 2 x 9 derivatives some ten thousand
// times. Where images see each other all around, a factor takes ten times as
// long at 1000 images. Where it has hardly a zero, dense takes three quarters
// of the time of sparse.
ceres::LinearSolverType SolverOfReducedSystem(const AdjustmentBlocks& blocks) {
  BlockStructure structure;
  structure.frame_is_fixed = blocks.frame_is_fixed;
  structure.point_begin = PointBegins(blocks);
  for (const AdjustmentObservation& observation : blocks.observations) {
    structure.frame_of.push_back(observation.frame);
  }
  const BlockPattern pattern = PairsThatSharePoints(structure);
  const SparseFactorSize factor = FindSparseFactorSize(pattern);
  // Blocks are 6 x 6, not 3 x 3: eight times the operations.
  if (8 * factor.operations >
      1e4 * static_cast<double>(blocks.observations.size())) {
    return ceres::ITERATIVE_SCHUR;
  }
  const int64_t size = 3 * static_cast<int64_t>(pattern.num_columns());
  return 2 * factor.numbers > size * (size + 1) / 2 ? ceres::DENSE_SCHUR
                                                    : ceres::SPARSE_SCHUR;
}

}  // namespace

ReprojectionCost::ReprojectionCost(int camera_model, bool has_sensor,
                                   const Eigen::Vector2d& pixel)
    : pixel_(pixel), camera_model_(camera_model) {
  const CameraModelInfo* info = FindCameraModel(camera_model);
  if (info == nullptr) throw std::invalid_argument("unknown camera model");
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {3, 7};
  if (has_sensor) mutable_parameter_block_sizes()->push_back(7);
  mutable_parameter_block_sizes()->push_back(info->num_params);
}

bool ReprojectionCost::Evaluate(double const* const* blocks, double* residuals,
                                double** jacobians) const {
  const int camera = static_cast<int>(parameter_block_sizes().size()) - 1;
  const bool has_sensor = camera > kSensor;
  const Eigen::Map<const Vector3d> x_world(blocks[kPoint]);
  const BlockTransform rig_from_world(blocks[kFrame]);
  const Vector3d x_rig = rig_from_world * x_world;
  std::optional<BlockTransform> sensor_from_rig;
  if (has_sensor) sensor_from_rig.emplace(blocks[kSensor]);
  const Vector3d x_cam = has_sensor ? *sensor_from_rig * x_rig : x_rig;
  if (!(x_cam.z() > 0)) return false;

  const Eigen::Vector2d ray = x_cam.hnormalized();
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  if (jacobians == nullptr) {
    residual = ProjectRay({camera_model_, blocks[camera]}, ray) - pixel_;
    return residual.allFinite();
  }
  const DifferentiatedPixel projected = DifferentiatePixel(
      {camera_model_, blocks[camera]}, ray, jacobians[camera]);
  residual = projected.pixel - pixel_;
  Matrix23 J;  // by x_cam, then by x_rig
  J << projected.J_ray, -projected.J_ray * ray;
  J /= x_cam.z();
  if (has_sensor) {
    if (jacobians[kSensor] != nullptr) {
      StoreJacobian<7>(J * sensor_from_rig->BlockJacobian(x_rig),
                       jacobians[kSensor]);
    }
    J = J * sensor_from_rig->rotation;
  }
  StoreJacobian<3>(J * rig_from_world.rotation, jacobians[kPoint]);
  if (jacobians[kFrame] != nullptr) {
    StoreJacobian<7>(J * rig_from_world.BlockJacobian(x_world),
                     jacobians[kFrame]);
  }
  return residual.allFinite();
}

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
  AddSurveyBlocks(blocks, problem);
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
  // As the gauge is free, only the damping, the diagonal of J'J divided by the
  // radius, makes the normal equations positive definite. With a larger radius
  // rounding would decide whether they are.
  solver.max_trust_region_radius = 1e8;
  solver.num_threads = ResolveNumThreads(context.num_threads);
  if (!options.refine_points3D) {
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    return solver;
  }

  if (blocks->num_images <= options.max_num_images_direct_dense) {
    solver.linear_solver_type = ceres::DENSE_SCHUR;
  } else {
    solver.linear_solver_type =
        blocks->num_images <= options.max_num_images_direct_sparse
            ? SolverOfReducedSystem(*blocks)
            : ceres::ITERATIVE_SCHUR;
  }
  solver.preconditioner_type = ceres::SCHUR_JACOBI;  // of ITERATIVE_SCHUR
  // One group per camera, because within a group Ceres orders blocks by their
  // addresses, which differ from run to run for separate vectors. Points at
  // which distances end cannot be eliminated one by one.
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  const auto add = [&](double* block, int group) {
    if (problem.HasParameterBlock(block)) {
      ordering->AddElementToGroup(block, group);
    }
  };
  std::vector<char> is_end(blocks->points.size(), 0);
  for (const DistanceObservation& distance : blocks->distances) {
    for (const Place& end : distance.ends) {
      if (end.point >= 0) is_end[end.point] = 1;
    }
  }
  for (size_t k = 0; k < blocks->points.size(); ++k) {
    add(blocks->points[k].data(), is_end[k] != 0 ? 3 : 0);
  }
  for (PoseBlock& frame : blocks->frames) add(frame.data(), 1);
  for (PoseBlock& sensor : blocks->sensors) add(sensor.data(), 2);
  int group = 4;
  for (std::vector<double>& camera : blocks->cameras) {
    add(camera.data(), group++);
  }
  solver.linear_solver_ordering = std::move(ordering);
  return solver;
}

double UnitOfLength(const AdjustmentBlocks& blocks, const Context& context) {
  std::vector<double> distances;
  int32_t point = -1;
  for (const AdjustmentObservation& observation : blocks.observations) {
    if (observation.point == point) continue;
    point = observation.point;
    distances.push_back(
        (blocks.points[point] - CenterOf(blocks.frames[observation.frame]))
            .norm());
  }
  const double median = distances.empty() ? 0 : MedianOf(distances, context);
  return std::isnormal(median) ? std::exp2(std::round(std::log2(median))) : 1;
}

void DivideLengths(double unit, AdjustmentBlocks* blocks) {
  const auto divide = [&](PoseBlock* pose) {
    for (size_t i = 4; i < pose->size(); ++i) (*pose)[i] /= unit;
  };
  for (PoseBlock& frame : blocks->frames) divide(&frame);
  for (PoseBlock& sensor : blocks->sensors) divide(&sensor);
  for (Vector3d& point : blocks->points) point /= unit;
  for (PositionObservation& position : blocks->positions) {
    position.position /= unit;
    position.px_from_world *= unit;
  }
  for (DistanceObservation& distance : blocks->distances) {
    distance.length /= unit;
    distance.px_from_world *= unit;
  }
}

std::optional<double> Stationarity(int num_threads, double cost,
                                   ceres::Problem* problem) {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = num_threads;
  std::vector<double> gradient;
  ceres::CRSMatrix jacobian;
  if (!problem->Evaluate(options, nullptr, nullptr, &gradient, &jacobian)) {
    return std::nullopt;
  }
  if (cost <= 0) return 0.0;
  std::vector<double> diagonal(gradient.size(), 0.0);
  for (size_t i = 0; i < jacobian.values.size(); ++i) {
    diagonal[jacobian.cols[i]] += jacobian.values[i] * jacobian.values[i];
  }
  double sum = 0;
  for (size_t j = 0; j < gradient.size(); ++j) {
    if (diagonal[j] > 0) sum += gradient[j] * gradient[j] / diagonal[j];
  }
  return sum / (2 * cost);
}

}  // namespace krot::internal
