#include "krot/pipeline/solve_model.h"

#include <utility>

#include "krot/base/check.h"
#include "krot/base/timer.h"
#include "krot/pipeline/iteration_log.h"
#include "krot/pipeline/schedule.h"
#include "krot/pipeline/solve_memory.h"
#include "krot/pipeline/start.h"
#include "krot/problem/components.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"

namespace krot {
namespace {

bool HasJointSolver(Norm norm) { return norm.p == 2 || norm.IsPolyhedral(); }

void CheckOptions(const SolveModelOptions& options) {
  CheckArgument(options.norm.p >= 1, "norm.p", options.norm.p, ">= 1");
  CheckArgument(options.init_max_error > 0, "init_max_error",
                options.init_max_error, "> 0");
  CheckArgument(
      options.init == SolveInit::kModel || HasJointSolver(options.norm),
      "norm.p", options.norm.p, "1, 2 or infinity with this init");
  CheckArgument(
      options.method != SolveMethod::kJoint || HasJointSolver(options.norm),
      "norm.p", options.norm.p, "1, 2 or infinity with this method");
}

void CountProblem(const Model& model, const BuiltProblem& built,
                  SolveSummary* summary) {
  const KnownRotationProblem& problem = built.problem;
  summary->num_frames = problem.num_frames;
  summary->num_images = static_cast<int64_t>(problem.views.size());
  summary->num_points = problem.num_points;
  summary->num_observations = static_cast<int64_t>(problem.observations.size());
  summary->num_components = FindComponents(problem).count;
  summary->left_out = built.left_out;
  summary->num_retriangulated_points = built.num_retriangulated_points;
  const SolveMemory memory = EstimateSolveMemory(model, built, *summary);
  summary->likely_bytes = memory.likely;
  summary->largest_bytes = memory.at_most;
}

// Checks the certificate once more, apart from the solver that made it, and
// says what it proves about the estimate.
void Certify(const Model& model, const Start& start, const Estimate& estimate,
             const SolveModelOptions& options,
             const std::optional<Certificate>& certificate,
             SolveSummary* summary) {
  if (!certificate) return;
  const Timer timer;
  const CertificateCheck check =
      CheckCertificate(start.built.problem, options.norm, *certificate);
  if (check.is_accepted) {
    summary->is_certified = true;
    summary->lower_bound = check.proved_bound;
    summary->support =
        ListSupport(model, start.built, estimate, options.norm, *certificate);
    if (options.describe_certificate) {
      summary->certificate =
          DescribeCertificate(model, start.built, options.norm, *certificate);
    }
  }
  summary->seconds_certify = timer.Seconds();
}

// With the final cost. What is claimed is what the numbers say, whatever the
// solver thought.
void MeasureGap(double wanted_gap, SolveSummary* summary) {
  if (summary->cost_final == 0) summary->lower_bound = 0;  // without proof
  if (summary->lower_bound) {
    summary->relative_gap =
        summary->cost_final > 0
            ? (summary->cost_final - *summary->lower_bound) /
                  summary->cost_final
            : 0;
  }
  if (summary->termination != SolveTermination::kGapReached) return;
  if (IsZeroUpToRounding(summary->cost_final)) {
    summary->termination = SolveTermination::kZeroCost;
  } else if (!(summary->relative_gap && *summary->relative_gap <= wanted_gap)) {
    summary->termination = SolveTermination::kStalled;
  }
}

// Finds the estimate to start from; false, and the termination why, if there
// is none.
bool FindEstimate(const Model& model, const SolveModelOptions& options,
                  const Context& context, const Timer& timer, Start* start,
                  Estimate* estimate, SolveSummary* summary) {
  if (start->init == SolveInit::kModel) {
    *estimate = start->built.start;
    return true;
  }
  FoundStart found =
      FindFeasibleStart(start->built.problem, options, context,
                        LogIterations(options.joint.callback, timer, summary));
  if (found.estimate) {
    *estimate = *std::move(found.estimate);
    return true;
  }
  summary->termination = found.termination;
  const bool was_asked = options.init == SolveInit::kFeasible;
  if (found.termination == SolveTermination::kInterrupted || was_asked) {
    Certify(model, *start, start->built.start, options, found.certificate,
            summary);
    return false;
  }
  context.Note("there is none; going on without those observations");
  *start = OwnStart(model, options, context);
  summary->init = start->init;
  CountProblem(model, start->built, summary);
  *estimate = start->built.start;
  summary->termination = SolveTermination::kNothingToSolve;
  return !start->built.problem.observations.empty();
}

}  // namespace

SolveMethod EffectiveMethod(const SolveModelOptions& options) {
  if (options.method != SolveMethod::kAuto) return options.method;
  const bool as_in_paper =
      options.res_int.fast_descent.settings == FastDescentSettings::kPaper;
  return as_in_paper || !HasJointSolver(options.norm) ? SolveMethod::kResInt
                                                      : SolveMethod::kAuto;
}

SolveModelResult SolveModel(const Model& model,
                            const SolveModelOptions& options,
                            const Context& context) {
  CheckOptions(options);
  SolveModelResult result;
  SolveSummary& summary = result.summary;
  summary.method = EffectiveMethod(options);
  summary.norm = options.norm;

  const Timer build_timer;
  Start start = ChooseStart(model, options, summary.method, context);
  summary.init = start.init;
  CountProblem(model, start.built, &summary);
  summary.pixel_error_before =
      Summarize(PixelErrors(model, context.num_threads));
  summary.pixel_error_after = summary.pixel_error_before;
  summary.seconds_build = build_timer.Seconds();
  if (options.on_built) options.on_built(summary);
  if (start.built.problem.observations.empty()) {
    summary.termination = SolveTermination::kNothingToSolve;
    result.model = model;
    return result;
  }

  const Timer solve_timer;
  Estimate estimate;
  if (!FindEstimate(model, options, context, solve_timer, &start, &estimate,
                    &summary)) {
    summary.seconds_solve = solve_timer.Seconds();
    result.model = model;
    return result;
  }
  const KnownRotationProblem& problem = start.built.problem;
  const std::optional<Certificate> certificate =
      RunSchedule(problem, options, summary.method, context, solve_timer,
                  &estimate, &summary);
  if (options.res_int.update_frames) {
    RestoreGauge(problem, start.built.start, &estimate);
    summary.cost_final =
        Cost(problem, estimate, options.norm, context.num_threads);
  }
  result.model = ApplyEstimate(model, start.built, estimate);
  const std::vector<double> errors_px =
      PixelErrors(result.model, context.num_threads);
  UpdatePointErrors(errors_px, &result.model);
  summary.pixel_error_after = Summarize(errors_px);
  summary.seconds_solve = solve_timer.Seconds();

  Certify(model, start, estimate, options, certificate, &summary);
  MeasureGap(options.joint.relative_gap, &summary);
  if (options.polish != Polish::kNone && !context.IsCancelled()) {
    summary.polish = PolishModel(options.polish, context, &result.model);
  }
  return result;
}

SolveModelResult TriangulateModel(const Model& model,
                                  const SolveModelOptions& options,
                                  const Context& context) {
  return SolveModel(model, PointsOnly(options), context);
}

SolveModelOptions PointsOnly(SolveModelOptions options) {
  options.method = SolveMethod::kResInt;
  options.init = SolveInit::kModel;
  options.polish = Polish::kNone;
  options.res_int.update_frames = false;
  options.res_int.max_sweeps = 1;
  return options;
}

}  // namespace krot
