// The public functions, from arrays to arrays and from model to model: their
// options become those of the library, and its summaries what they return.

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "krot/adjust.h"
#include "krot/base/check.h"
#include "krot/base/write_file.h"
#include "krot/certificate.h"
#include "krot/convert/certificate_file.h"
#include "krot/geometry.h"
#include "krot/joint/joint.h"
#include "krot/known_rotation.h"
#include "krot/minimax.h"
#include "krot/minimax/fast_descent.h"
#include "krot/outliers.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/solve.h"
#include "krot/tolerance/tolerance_analysis.h"
#include "krot/tolerances.h"

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

namespace {

SolveModelOptions PipelineOptions(const SolveOptions& options) {
  SolveModelOptions pipeline;
  pipeline.method = options.method;
  pipeline.init = options.init;
  pipeline.init_max_error = options.init_max_error;
  pipeline.norm = options.norm;
  pipeline.joint.relative_gap = options.relative_gap;
  pipeline.joint.max_iterations = options.max_iterations;
  pipeline.problem.min_track_length = options.min_track_length;
  if (options.keep_closest_of_image) {
    pipeline.problem.same_image = SameImage::kClosest;
  }
  pipeline.problem.fixed = options.fixed;
  pipeline.problem.positions = options.positions;
  if (!options.finish_by_least_squares) {
    pipeline.finish.finish = Finish::kNone;
  }
  pipeline.finish.slack = options.finish_slack;
  pipeline.finish.max_error = options.finish_max_error;
  pipeline.describe_certificate = options.write_certificate;
  if (options.on_progress) {
    const auto tell = [told = std::make_shared<SolveState>(),
                       on_progress = options.on_progress](
                          std::optional<double> max_error,
                          std::optional<double> lower_bound) {
      if (max_error) told->max_error = max_error;
      if (lower_bound) told->lower_bound = lower_bound;
      on_progress(*told);
    };
    pipeline.res_int.callback = [tell](int, const Sweep& sweep) {
      tell(sweep.cost, std::nullopt);
    };
    pipeline.joint.callback = [tell](int, const JointIteration& state) {
      tell(state.cost, state.lower_bound);
    };
    pipeline.finish.callback = [tell](const BoundedIterate&) { tell({}, {}); };
  }
  return pipeline;
}

SolveResult Described(SolveModelResult solved) {
  const SolveSummary& summary = solved.summary;
  SolveResult result;
  static_cast<SolveFindings&>(result) = summary;
  result.model = std::move(solved.model);
  result.max_error = summary.cost_final;
  result.lowest_max_error = summary.LowestCost();
  result.errors_before = summary.pixel_error_before;
  result.errors_after = summary.pixel_error_after;
  result.loose_images = summary.loose.images;
  if (summary.certificate) {
    result.certificate = CertificateJson(*summary.certificate);
  }
  return result;
}

}  // namespace

SolveResult Solve(const Model& model, const SolveOptions& options,
                  const Context& context) {
  return Described(SolveModel(model, PipelineOptions(options), context));
}

SolveResult Triangulate(const Model& model, const SolveOptions& options,
                        const Context& context) {
  return Described(TriangulateModel(model, PipelineOptions(options), context));
}

AdjustResult Adjust(const Model& model, const AdjustOptions& options,
                    const Context& context) {
  AdjustModelOptions pipeline;
  pipeline.adjustment = options.adjustment;
  pipeline.max_error_factor = options.max_error_factor;
  AdjustModelResult adjusted = AdjustModel(model, pipeline, context);
  AdjustModelSummary& summary = adjusted.summary;
  return {std::move(adjusted.model), std::move(summary.adjustment),
          summary.max_error,         summary.pixel_error_before,
          summary.pixel_error_start, summary.pixel_error_after};
}

OutlierResult RemoveOutliers(const Model& model, const OutlierOptions& options,
                             const Context& context) {
  OutlierFilterOptions pipeline;
  pipeline.method = options.method;
  pipeline.max_error = options.max_error;
  pipeline.find_conflicts = options.find_conflicts;
  pipeline.make_profile = options.make_profile;
  pipeline.solve = PipelineOptions(options.solve);
  OutlierFilterResult filtered = FilterOutliers(model, pipeline, context);
  const OutlierFilterSummary& summary = filtered.summary;
  OutlierResult result;
  static_cast<OutlierFindings&>(result) = summary;
  result.model = std::move(filtered.model);
  result.errors_before = summary.pixel_error_before;
  result.errors_after = summary.pixel_error_after;
  if (summary.solve) {
    result.termination = summary.solve->termination;
    result.lower_bound = summary.solve->lower_bound;
  }
  if (summary.conflicts) result.conflicts = ConflictJson(*summary.conflicts);
  return result;
}

TolerancesResult FindTolerances(const Model& model,
                                const TolerancesOptions& options,
                                const Context& context) {
  ToleranceOptions pipeline;
  static_cast<ToleranceRequest&>(pipeline) = options;
  pipeline.solve = PipelineOptions(options.solve);
  ToleranceResult found = AnalyzeTolerances(model, pipeline, context);
  ToleranceSummary& summary = found.summary;
  return {std::move(found.model),
          summary.termination,
          summary.cost,
          summary.lower_bound,
          std::move(summary.gauge_images),
          std::move(summary.boxes)};
}

CertificateVerdict VerifyCertificate(const Model& model,
                                     const std::string& json) {
  return VerifyCertificateFile(model, ParseCertificate(json, "certificate"));
}

ConflictVerdict VerifyConflicts(const Model& model, const std::string& json) {
  return VerifyConflictFile(model, ParseConflicts(json, "conflicts"));
}

std::string ReadCertificate(const std::filesystem::path& path) {
  return ReadCertificateText(path);
}

void WriteCertificate(const std::string& json,
                      const std::filesystem::path& path) {
  WriteFileAtomically(path, json);
}

}  // namespace krot
