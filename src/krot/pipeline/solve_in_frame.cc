#include "krot/pipeline/stages.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "krot/analysis/model_comparison.h"
#include "krot/analysis/model_input.h"
#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

void CheckOptions(const SolveModelOptions& options, const Context& context) {
  if (options.problem.fixed.Any())
    RequireOneRank(context, "what must not move");
  if (!options.problem.positions.empty()) {
    RequireOneRank(context, "what keeps positions");
  }
  if (options.polish != Polish::kNone) RequireOneRank(context, "a polish");
  if (options.problem.same_image == SameImage::kClosest) {
    RequireOneRank(context, "--Problem.same_image closest");
  }
  CheckArgument(options.norm.p >= 1, "norm.p", options.norm.p, ">= 1");
  CheckArgument(options.init_max_error > 0, "init_max_error",
                options.init_max_error, "> 0");
  CheckArgument(
      options.init == SolveInit::kModel || HasJointSolver(options.norm),
      "norm.p", options.norm.p, "1, 2 or infinity with this init");
  CheckArgument(
      options.method != SolveMethod::kJoint || HasJointSolver(options.norm),
      "norm.p", options.norm.p, "1, 2 or infinity with this method");
  if (options.problem.positions.empty()) return;
  CheckArgument(options.norm.p == 2, "norm.p", options.norm.p,
                "2 with problem.positions");
  CheckArgument(EffectiveMethod(options) != SolveMethod::kResInt, "method",
                "kResInt", "another with problem.positions");
  CheckArgument(options.polish == Polish::kNone, "polish", "not kNone",
                "kNone with problem.positions");
}

// Counts the parts of the whole problem, over all ranks. The memory needed is
// estimated for one process only, so not where ranks share the points.
void CountProblem(const Model& model, const BuiltProblem& built,
                  const Context& context, SolveSummary* summary) {
  const KnownRotationProblem& problem = built.problem;
  summary->num_frames = static_cast<int64_t>(built.frame_of.size());
  summary->num_images = static_cast<int64_t>(built.image_of.size());
  summary->num_points =
      SumOfRanks(context, static_cast<int64_t>(built.point_of.size()));
  summary->num_observations = SumOfRanks(context, built.NumPixels());
  summary->num_positions = static_cast<int64_t>(built.positions.size());
  summary->num_components = FindComponents(problem, context).count;
  for (int32_t f = 0; f < summary->num_frames; ++f) {
    summary->num_fixed_frames += problem.IsFixedFrame(f);
  }
  for (size_t k = 0; k < built.point_of.size(); ++k) {
    summary->num_fixed_points += problem.IsFixedPoint(static_cast<int32_t>(k));
  }
  for (size_t n = 0; n < built.left_out.size(); ++n) {
    summary->left_out[n] = SumOfRanks(context, built.left_out[n]);
  }
  summary->num_retriangulated_points =
      SumOfRanks(context, built.num_retriangulated_points);
  summary->num_same_image_tracks =
      SumOfRanks(context, built.num_same_image_tracks);
  if (context.ranks != nullptr) return;
  summary->needed_bytes = EstimateSolveMemory(model, built, *summary, context);
}

// Sets gap and termination from the final cost and the certified bound, so that
// what is claimed holds for these numbers, whatever the solver reported.
void MeasureGap(double wanted_gap, SolveSummary* summary) {
  if (summary->cost_final == 0) summary->lower_bound = 0;  // without proof
  if (summary->lower_bound && std::isfinite(summary->cost_final)) {
    summary->relative_gap =
        summary->cost_final > 0
            ? (summary->cost_final - *summary->lower_bound) /
                  summary->cost_final
            : 0;
  }
  // The gap asked for refers to the lowest maximum, before the finish.
  const auto is_within = [&](double gap) {
    return summary->relative_gap &&
           summary->LowestCost() - *summary->lower_bound <=
               gap * summary->LowestCost();
  };
  const bool has_ended =
      summary->termination == SolveTermination::kGapReached ||
      summary->termination == SolveTermination::kZeroCost ||
      summary->termination == SolveTermination::kStalled;
  if (summary->is_given_back && summary->collapse.IsWhole()) {
    summary->termination = SolveTermination::kCollapsed;
    return;
  }
  if (!has_ended || summary->method == SolveMethod::kResInt) return;
  if (summary->largest_position_ratio > 1 + kKeptPosition) {
    summary->termination = SolveTermination::kUnproved;
  } else if (IsZeroUpToRounding(summary->cost_final)) {
    summary->termination = SolveTermination::kZeroCost;
  } else if (is_within(wanted_gap)) {
    summary->termination = SolveTermination::kGapReached;
  } else {
    summary->termination = is_within(/*gap=*/1e-2)
                               ? SolveTermination::kStalled
                               : SolveTermination::kUnproved;
  }
}

// Finds the estimate to start from. If there is none, returns false and sets
// the termination to the reason.
bool FindEstimate(const SolveRun& run, Start* start, Estimate* estimate,
                  SolveSummary* summary) {
  const SolveModelOptions& options = run.options;
  const Context& context = run.context;
  if (start->init == SolveInit::kModel) {
    *estimate = start->built.start;
    return true;
  }
  if (options.found_start &&
      Cost(start->built.problem, *options.found_start, options.norm,
           context.num_threads) < options.init_max_error) {
    *estimate = *options.found_start;
    return true;
  }
  // If there is no start, rows of this level prove a bound for the positions:
  // their level must be below it.
  TakePositionRowsOfStart(0.99 * options.init_max_error, &start->built);
  FoundStart found = FindFeasibleStart(
      start->built.problem, options, context,
      LogIterations(options.joint.callback, run.timer, summary));
  if (found.estimate) {
    *estimate = *std::move(found.estimate);
    return true;
  }
  summary->termination = found.termination;
  const bool was_asked =
      options.init == SolveInit::kFeasible || !start->built.positions.empty();
  if (found.termination == SolveTermination::kInterrupted || was_asked) {
    CertifyInfeasible(run.model, start->built, options, context,
                      found.certificate, summary);
    return false;
  }
  context.Note("there is none; going on without those observations");
  *start = OwnStart(run.model, options, context);
  summary->init = start->init;
  CountProblem(run.model, start->built, context, summary);
  *estimate = start->built.start;
  summary->termination = SolveTermination::kNothingToSolve;
  return !start->built.problem.observations.empty();
}

// Whether the finish can start right away. If so, takes the rows at the
// estimate.
bool IsFinishEnough(const SolveRun& run, const Estimate& estimate,
                    BuiltProblem* built, SolveSummary* summary) {
  const double sufficient = SufficientCost(run.options, run.method);
  if (sufficient == 0) return false;
  const int num_threads = run.context.num_threads;
  const Reprojection reprojection(run.model, *built);
  const double cost = MaxOfRanks(
      run.context,
      reprojection.TrueCost(estimate, run.options.norm, num_threads));
  if (!(cost < sufficient)) return false;
  reprojection.TakeRows(estimate, num_threads, &built->problem);
  summary->cost_initial = summary->cost_final = cost;
  summary->termination = SolveTermination::kWithinBound;
  return true;
}

// The largest error of the track elements in this role; infinite where a point
// does not project.
double LargestOf(Role role, const std::vector<Role>& roles,
                 const std::vector<double>& errors_px, const Context& context) {
  double largest = 0;
  for (size_t e = 0; e < roles.size(); ++e) {
    if (roles[e] != role) continue;
    largest = std::max(largest, std::isfinite(errors_px[e])
                                    ? errors_px[e]
                                    : std::numeric_limits<double>::infinity());
  }
  return MaxOfRanks(context, largest);
}

// The errors without those of twins, which were left out as wrong.
std::vector<double> Counted(const std::vector<Role>& roles,
                            std::vector<double> errors_px) {
  size_t num_kept = 0;
  for (size_t e = 0; e < roles.size(); ++e) {
    if (roles[e] != Role::kTwin) errors_px[num_kept++] = errors_px[e];
  }
  errors_px.resize(num_kept);
  return errors_px;
}

// Whether some error that was finite before is now above the largest finite
// error before, and above what is allowed; all in the norm of the solve.
bool IsWorse(const std::vector<double>& errors_before_px,
             const std::vector<double>& errors_after_px, double allowed_px,
             const Context& context) {
  double largest = allowed_px;
  for (const double error : errors_before_px) {
    if (std::isfinite(error)) largest = std::max(largest, error);
  }
  largest = MaxOfRanks(context, largest) * (1 + kErrorRounding);
  bool is_worse = false;
  for (size_t i = 0; i < errors_before_px.size(); ++i) {
    is_worse |=
        std::isfinite(errors_before_px[i]) && !(errors_after_px[i] <= largest);
  }
  return AnyRank(context, is_worse);
}

// Whether there are at most as many equations, two per observation, as unknowns
// less the gauge. Then all errors may be zero whatever the observations are.
bool IsUnderdetermined(const SolveSummary& summary,
                       const KnownRotationProblem& problem) {
  const bool is_held = summary.num_fixed_frames + summary.num_fixed_points > 0;
  const int64_t gauge =
      is_held ? 0 : (HasBaseline(problem) ? 3 : 4) * summary.num_components;
  return summary.num_positions == 0 &&
         2 * summary.num_observations <=
             3 * (summary.num_frames - summary.num_fixed_frames +
                  summary.num_points - summary.num_fixed_points) -
                 gauge;
}

// Sets `moved` of the loose images and points: how far they have moved between
// two models with the same images and points.
void MeasureMoves(const Model& before, const Model& after, LooseParts* loose) {
  const std::vector<ImageGeometry> from = ImageGeometries(before);
  const std::vector<ImageGeometry> to = ImageGeometries(after);
  const IdIndex<ImageId> images(before.images);
  for (LooseImage& image : loose->images) {
    const int32_t n = *images.Find(image.image_id);
    image.moved =
        (Center(to[n].cam_from_world) - Center(from[n].cam_from_world)).norm();
  }
  const IdIndex<Point3DId> points(before.points3D);
  for (LoosePoint& point : loose->points) {
    const int32_t n = *points.Find(point.point3D_id);
    point.moved = (after.points3D[n].xyz - before.points3D[n].xyz).norm();
  }
}

}  // namespace

SolveModelResult SolveInFrame(const Model& model,
                              const SolveModelOptions& options,
                              const Context& context) {
  CheckOptions(options, context);
  SolveModelResult result;
  SolveSummary& summary = result.summary;
  summary.method = EffectiveMethod(options);
  summary.norm = options.norm;

  const int num_threads = context.num_threads;
  context.Stage("setting up the problem");
  const Timer build_timer;
  Start start = ChooseStart(model, options, summary.method, context);
  summary.init = start.init;
  CountProblem(model, start.built, context, &summary);
  std::vector<double> before_px = PixelErrors(model, num_threads);
  summary.pixel_error_before = Summarize(before_px);
  summary.pixel_error_after = summary.pixel_error_before;
  summary.seconds_build = build_timer.Seconds();
  if (options.on_built) options.on_built(summary);
  const Timer solve_timer;
  const SolveRun run{model, options, summary.method, context, solve_timer};
  const auto end_without = [&] {
    summary.seconds_solve = solve_timer.Seconds();
    result.model = model;
    return result;
  };
  if (summary.num_observations + summary.num_positions == 0) {
    summary.termination = SolveTermination::kNothingToSolve;
    return end_without();
  }
  Estimate estimate;
  if (!FindEstimate(run, &start, &estimate, &summary)) return end_without();
  std::optional<PixelCertificate> certificate;
  if (!IsFinishEnough(run, estimate, &start.built, &summary)) {
    certificate = SolveInRounds(run, &start.built, &estimate, &summary);
    if (summary.method == SolveMethod::kAuto && context.ranks == nullptr &&
        HasJointSolver(options.norm)) {
      TryOtherWays(run, &start, &estimate, &certificate, &summary);
    }
  }
  if (summary.termination == SolveTermination::kInfeasible) {
    Certify(model, start.built, estimate, options, context, certificate,
            &summary);
    return end_without();
  }
  if (summary.method == SolveMethod::kAuto &&
      summary.termination != SolveTermination::kInterrupted) {
    context.Stage("finding the least squares below the largest error");
    RunFinish(
        run,
        certificate ? std::optional(certificate->lower_bound) : std::nullopt,
        &start.built, &estimate, &summary);
  }
  summary.loose =
      SettleEstimate(model, start.built, options.norm,
                     options.res_int.update_frames, context, &estimate);
  PutFixed(start.built.problem, &estimate);
  summary.largest_position_ratio = LargestPositionRatio(start.built, estimate);
  const Reprojection reprojection(model, start.built);
  if (summary.loose.have_moved) {
    reprojection.TakeRows(estimate, num_threads, &start.built.problem);
    if (summary.finish) {
      summary.finish->solve.cost_final =
          SumOfLosses(reprojection, start.built.problem, summary.finish->loss,
                      estimate, context);
    }
  }
  const double level = MaxOfRanks(
      context, reprojection.TrueCost(estimate, options.norm, num_threads));
  result.model = ApplyEstimate(model, start.built, estimate);
  if (options.norm.p != 2) {
    before_px = PixelErrors(model, num_threads, options.norm);
  }
  CarryLeftOutPoints(model, before_px, options.norm, start.built,
                     options.problem.fixed, level, &result.model);
  std::vector<double> after_px =
      PixelErrors(result.model, num_threads, options.norm);
  const std::vector<Role> roles =
      RolesOf(model, start.built, options.problem.same_image);
  summary.collapse = FindCollapse(model, result.model, context);
  const double allowed = options.finish.max_error.value_or(0);
  if (context.ranks == nullptr) {
    const auto worse = WorseImagesSide(model, result.model, options.norm);
    if (worse && worse->second > allowed) summary.worse_images_side = worse;
  }
  // Known positions may raise errors above the input's, but not without bound.
  if (!start.built.positions.empty() && !context.IsCancelled() &&
      IsWorse(Counted(roles, before_px), Counted(roles, after_px),
              std::max(allowed, options.init_max_error), context)) {
    summary.termination = SolveTermination::kNoStart;
    return end_without();
  }
  if (start.built.positions.empty() &&
      (summary.collapse.IsWhole() || summary.worse_images_side ||
       IsWorse(Counted(roles, before_px), Counted(roles, after_px), allowed,
               context))) {
    if (options.init == SolveInit::kFeasible && !context.IsCancelled()) {
      SolveModelOptions own = options;
      own.init = SolveInit::kModel;
      own.on_built = nullptr;
      const BuiltProblem built = OwnStart(model, own, context).built;
      if (HasOwnStart(built) && built.NumPixels() >= start.built.NumPixels()) {
        context.Note("no better than the input; from the model's positions");
        return SolveInFrame(model, own, context);
      }
    }
    summary.is_given_back = true;
    summary.loose = {};
    summary.finish.reset();
    result.model = model;
    after_px = before_px;
    estimate = OwnEstimate(model, start.built);
    reprojection.TakeRows(estimate, num_threads, &start.built.problem);
  }
  summary.cost_final = LargestOf(Role::kIn, roles, after_px, context);
  summary.is_underdetermined = IsUnderdetermined(summary, start.built.problem);
  const auto in_pixels = [&](const Model& m, const std::vector<double>& px) {
    return options.norm.p == 2 ? px : PixelErrors(m, num_threads);
  };
  const std::vector<double> errors_px = in_pixels(result.model, after_px);
  UpdatePointErrors(errors_px, &result.model);
  summary.pixel_error_before =
      Summarize(Counted(roles, in_pixels(model, before_px)));
  summary.pixel_error_after = Summarize(Counted(roles, errors_px));
  summary.largest_twin_error =
      LargestOf(Role::kTwin, roles, errors_px, context);
  summary.seconds_solve = solve_timer.Seconds();

  context.Stage("checking the proof");
  Certify(model, start.built, estimate, options, context, certificate,
          &summary);
  MeasureGap(options.joint.relative_gap, &summary);
  if (options.polish != Polish::kNone && !context.IsCancelled()) {
    context.Stage("polishing");
    summary.polish = PolishModel(options.polish, options.finish.loss,
                                 options.problem.fixed, context, &result.model);
    MeasureMoves(model, result.model, &summary.loose);
  }
  return result;
}

}  // namespace krot::internal
