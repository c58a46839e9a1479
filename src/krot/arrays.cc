// The public functions from arrays to arrays.

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "krot/base/check.h"
#include "krot/geometry.h"
#include "krot/joint/joint.h"
#include "krot/known_rotation.h"
#include "krot/minimax.h"
#include "krot/minimax/fast_descent.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

using namespace internal;

namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// (A, b; c, d) = E (M x + m), with the row E = [e3'; f (I2 | -ray)].
Residual ResidualOf(const Matrix3d& M, const Vector3d& m, const Vector2d& ray,
                    double focal_length) {
  const Matrix3d E = RowAtRay(ray, focal_length * Eigen::Matrix2d::Identity());
  Residual residual;
  residual.A = E.bottomRows<2>() * M;
  residual.b = E.bottomRows<2>() * m;
  residual.c = (E.row(0) * M).transpose();
  residual.d = E.row(0).dot(m);
  return residual;
}

std::string Name(const char* array, size_t n, const char* field) {
  return std::string(array) + "[" + std::to_string(n) + "]" + field;
}

void CheckInput(const KnownRotations& input) {
  constexpr double kOrthonormal = 1e-6;
  const size_t num_cameras = input.rotations.size();
  for (size_t c = 0; c < num_cameras; ++c) {
    const Matrix3d& R = input.rotations[c];
    const double defect = (R * R.transpose() - Matrix3d::Identity()).norm();
    CheckArgument(defect <= kOrthonormal && R.determinant() > 0,
                  Name("rotations", c, ""), "no rotation",
                  "orthonormal with determinant 1");
  }
  CheckArgument(
      input.focal_lengths.empty() || input.focal_lengths.size() == num_cameras,
      "focal_lengths.size()", input.focal_lengths.size(),
      "0 or that of rotations");
  for (size_t c = 0; c < input.focal_lengths.size(); ++c) {
    const double f = input.focal_lengths[c];
    CheckArgument(std::isfinite(f) && f > 0, Name("focal_lengths", c, ""), f,
                  "finite and > 0");
  }
  CheckAtLeast(0, input.num_points, "num_points");
  for (size_t i = 0; i < input.observations.size(); ++i) {
    const RayObservation& seen = input.observations[i];
    CheckArgument(
        seen.camera >= 0 && static_cast<size_t>(seen.camera) < num_cameras,
        Name("observations", i, ".camera"), seen.camera,
        "in [0, " + std::to_string(num_cameras) + ")");
    CheckArgument(seen.point >= 0 && seen.point < input.num_points,
                  Name("observations", i, ".point"), seen.point,
                  "in [0, " + std::to_string(input.num_points) + ")");
    CheckArgument(seen.ray.allFinite(), Name("observations", i, ".ray"),
                  seen.ray.transpose(), "finite");
  }
}

KnownRotationProblem ProblemOf(const KnownRotations& input) {
  KnownRotationProblem problem;
  problem.num_frames = static_cast<int32_t>(input.rotations.size());
  problem.num_points = input.num_points;
  for (int32_t c = 0; c < problem.num_frames; ++c) {
    problem.views.push_back(
        {input.rotations[c], Matrix3d::Identity(), Vector3d::Zero(), c});
  }
  for (const RayObservation& seen : input.observations) {
    const double f =
        input.focal_lengths.empty() ? 1 : input.focal_lengths[seen.camera];
    problem.observations.push_back(
        {RowAtRay(seen.ray, f * Eigen::Matrix2d::Identity()), seen.camera,
         seen.point});
  }
  std::stable_sort(problem.observations.begin(), problem.observations.end(),
                   [](const Observation& a, const Observation& b) {
                     return a.point < b.point;
                   });
  IndexObservations(&problem);
  return problem;
}

KnownRotationsTermination TerminationOf(SolveTermination termination) {
  switch (termination) {
    case SolveTermination::kGapReached:
      return KnownRotationsTermination::kGapReached;
    case SolveTermination::kMaxIterations:
      return KnownRotationsTermination::kMaxIterations;
    case SolveTermination::kStalled:
      return KnownRotationsTermination::kStalled;
    case SolveTermination::kInfeasible:
      return KnownRotationsTermination::kInfeasible;
    case SolveTermination::kNoStart:
      return KnownRotationsTermination::kNoStart;
    case SolveTermination::kInterrupted:
      return KnownRotationsTermination::kInterrupted;
    default:
      return KnownRotationsTermination::kNotRun;
  }
}

}  // namespace

Residual PointResidual(const RigidTransform& cam_from_world,
                       const Vector2d& ray, double focal_length) {
  return ResidualOf(cam_from_world.rotation, cam_from_world.translation, ray,
                    focal_length);
}

Residual CameraResidual(const Matrix3d& cam_from_world_rotation,
                        const Vector3d& point, const Vector2d& ray,
                        double focal_length) {
  return ResidualOf(Matrix3d::Identity(), cam_from_world_rotation * point, ray,
                    focal_length);
}

DescentSummary MinimizeLargestResidual(const std::vector<Residual>& residuals,
                                       const FastDescentOptions& options,
                                       Norm norm, Vector3d* x) {
  FastDescent descent(options, norm);
  for (const Residual& residual : residuals) descent.residuals().Add(residual);
  return descent.Minimize(x);
}

KnownRotationsResult SolveKnownRotations(const KnownRotations& problem,
                                         const KnownRotationsOptions& options,
                                         const Context& context) {
  CheckInput(problem);
  const KnownRotationProblem built = ProblemOf(problem);
  InitializerOptions start;
  start.norm = options.norm;
  start.max_error = options.init_max_error;
  JointOptions joint;
  joint.norm = options.norm;
  joint.relative_gap = options.relative_gap;
  joint.max_iterations = options.max_iterations;

  KnownRotationsResult result;
  Estimate estimate;
  estimate.translations.resize(built.num_frames, Vector3d::Zero());
  estimate.points.resize(built.num_points, Vector3d::Zero());
  const InitializerSummary found = FindStart(built, start, context, &estimate);
  if (found.termination != SolveTermination::kWithinBound) {
    result.termination = TerminationOf(found.termination);
    result.lower_bound = found.lower_bound;
    return result;
  }
  const JointSummary solved = SolveJoint(built, joint, context, &estimate);
  result.termination = TerminationOf(solved.termination);
  result.max_error = solved.cost_final;
  result.lower_bound = solved.lower_bound;
  result.translations = std::move(estimate.translations);
  result.points = std::move(estimate.points);
  return result;
}

}  // namespace krot
