#include "krot/pipeline/solve_model.h"

#include "krot/base/timer.h"
#include "krot/problem/gauge.h"

namespace krot {
namespace {

SolveTermination FromResInt(ResIntTermination termination) {
  switch (termination) {
    case ResIntTermination::kStalled:
      return SolveTermination::kStalled;
    case ResIntTermination::kMaxSweeps:
      return SolveTermination::kMaxSweeps;
    case ResIntTermination::kInterrupted:
      return SolveTermination::kInterrupted;
    case ResIntTermination::kNotRun:
      break;
  }
  return SolveTermination::kNotRun;
}

void CountProblem(const BuiltProblem& built, SolveSummary* summary) {
  const KnownRotationProblem& problem = built.problem;
  summary->num_frames = problem.num_frames;
  summary->num_images = static_cast<int64_t>(problem.views.size());
  summary->num_points = problem.num_points;
  summary->num_observations = static_cast<int64_t>(problem.observations.size());
  summary->left_out = built.left_out;
  summary->num_retriangulated_points = built.num_retriangulated_points;
}

SolveModelResult Solve(const Model& model, const SolveModelOptions& options) {
  const int num_threads = options.res_int.num_threads;
  SolveModelResult result;
  SolveSummary& summary = result.summary;
  summary.norm = options.res_int.norm;

  const Timer build_timer;
  const BuiltProblem built = BuildProblem(model, options.problem);
  CountProblem(built, &summary);
  summary.pixel_error_before = Summarize(PixelErrors(model, num_threads));
  summary.pixel_error_after = summary.pixel_error_before;
  summary.seconds_build = build_timer.Seconds();
  if (options.on_built) options.on_built(summary);
  if (built.problem.observations.empty()) {
    summary.termination = SolveTermination::kNothingToSolve;
    result.model = model;
    return result;
  }

  const Timer solve_timer;
  Estimate estimate = built.start;
  const ResIntSummary res_int =
      SolveResInt(built.problem, options.res_int, &estimate);
  summary.termination = FromResInt(res_int.termination);
  summary.cost_initial = res_int.cost_initial;
  summary.cost_final = res_int.cost_final;
  summary.sweeps = res_int.sweeps;

  if (options.res_int.update_frames) {
    RestoreGauge(built.problem, built.start, &estimate);
  }
  result.model = ApplyEstimate(model, built, estimate);
  const std::vector<double> errors_px = PixelErrors(result.model, num_threads);
  UpdatePointErrors(errors_px, &result.model);
  summary.pixel_error_after = Summarize(errors_px);
  summary.seconds_solve = solve_timer.Seconds();
  return result;
}

}  // namespace

SolveModelResult SolveModel(const Model& model,
                            const SolveModelOptions& options) {
  return Solve(model, options);
}

SolveModelResult TriangulateModel(const Model& model,
                                  const SolveModelOptions& options) {
  SolveModelOptions points_only = options;
  points_only.res_int.update_frames = false;
  points_only.res_int.max_sweeps = 1;
  return Solve(model, points_only);
}

int64_t EstimateSolveBytes(const Model& model) {
  // Per observation: the Observation, two indices, the pixel errors before
  // and after. Per point: start, estimate and the solver's own record.
  constexpr int64_t kBytesPerObservation = 64 + 2 * 4 + 2 * 8;
  constexpr int64_t kBytesPerPoint = 2 * 24 + 8 + 200;
  int64_t bytes = 0;
  for (const Image& image : model.images) {
    bytes += static_cast<int64_t>(sizeof(Image) +
                                  image.points2D.size() * sizeof(Point2D));
  }
  bytes += static_cast<int64_t>(model.track_elements.size()) *
           (kBytesPerObservation + static_cast<int64_t>(sizeof(TrackElement)));
  bytes += static_cast<int64_t>(model.points3D.size()) *
           (kBytesPerPoint + static_cast<int64_t>(sizeof(Point3D)));
  return bytes;
}

}  // namespace krot
