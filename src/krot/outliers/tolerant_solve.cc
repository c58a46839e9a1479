
#include <algorithm>
#include <sstream>
#include <string>
#include <utility>

#include "krot/convert/reprojection.h"
#include "krot/finish/least_squares.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/outliers/robust_start.h"
#include "krot/pipeline/stages.h"

namespace krot::internal {
namespace {

std::string Pixels(double value) {
  std::ostringstream words;
  words.precision(3);
  words << value << " px";
  return words.str();
}

// Starts from nothing; errors above `level` count as wrong.
void PlaceFromTracks(Norm norm, double level, const Context& context,
                     RemovalStart* start) {
  start->init = SolveInit::kFeasible;
  const KnownRotationProblem& problem = start->built.problem;
  start->built.start = FindRobustStart(problem, norm, level, context);
  MinimizeRobustly(problem, context, &start->built.start);
  context.Note("positions from rotations and tracks: the median error is " +
               Pixels(MedianError(problem, start->built.start, norm)));
}

// Whether the model has positions at which noise explains half of its errors
// and none is gross.
bool FitsItsPositions(const Model& model, const OutlierFilterOptions& options,
                      const Context& context, double explained) {
  BuildProblemOptions build = options.solve.problem;
  build.num_threads = context.num_threads;
  const BuiltProblem own = BuildProblem(model, build);
  const Norm norm = options.solve.norm;
  return HasOwnStart(own) &&
         MedianError(own.problem, own.start, norm) <= explained &&
         Reprojection(model, own)
                 .TrueCost(own.start, norm, context.num_threads) <=
             options.solve.init_max_error;
}

}  // namespace

RemovalStart FindRemovalStart(const Model& model,
                              const OutlierFilterOptions& options,
                              const Context& context) {
  BuildProblemOptions build = options.solve.problem;
  build.num_threads = context.num_threads;
  build.ignore_translations = options.solve.init == SolveInit::kFeasible;
  RemovalStart start;
  start.max_error = options.max_error.value_or(0);
  start.built = BuildProblem(model, build);
  if (!build.ignore_translations && !HasOwnStart(start.built)) {
    build.ignore_translations = true;
    start.built = BuildProblem(model, build);
  }
  const Norm norm = options.solve.norm;
  if (build.ignore_translations) {
    const double level = options.max_error.value_or(kLevelOfStart);
    PlaceFromTracks(norm, std::min(kLevelOfStart, level), context, &start);
  }
  if (start.init == SolveInit::kFeasible && !options.max_error &&
      !options.make_profile) {
    const NoiseLimit noise =
        NoiseLimitAtStart(model, start.built, norm, context);
    start.max_error = noise.max_error;
    const double largest =
        Reprojection(model, start.built)
            .TrueCost(start.built.start, norm, context.num_threads);
    // A start's errors are larger than the lowest maximum, so that these do not
    // show that an observation has to go.
    start.nearly_fits = largest <= 3 * start.max_error;
    start.fits_its_positions =
        !options.has_other_rotations &&
        FitsItsPositions(model, options, context, start.max_error);
    if (options.spares_what_fits &&
        (start.nearly_fits || start.fits_its_positions)) {
      return start;
    }
    context.Note("leaving out what noise of " + Pixels(noise.sigma) +
                 " per axis does not explain: errors above " +
                 Pixels(start.max_error));
  }
  if (options.has_start_from_nothing) start.init = SolveInit::kFeasible;
  return start;
}

namespace {

// Whether observations may be removed if no start satisfies all.
bool AllowsRemoval(const SolveModelOptions& options) {
  return !options.problem.fixed.Any() && options.problem.positions.empty() &&
         EffectiveMethod(options) == SolveMethod::kAuto && options.norm.p == 2;
}

TolerantSolveResult SolveWithoutOutliers(const Model& model,
                                         const TolerantSolveOptions& options,
                                         bool spares_what_fits,
                                         const Context& context) {
  OutlierFilterOptions filter = options;
  filter.spares_what_fits = spares_what_fits;
  filter.solve.on_built = nullptr;
  filter.solve.find_lowest = options.solve.describe_certificate;
  OutlierFilterResult filtered = FilterOutliers(model, filter, context);
  TolerantSolveResult result;
  if (filtered.summary.solve) {
    result.summary = *std::exchange(filtered.summary.solve, std::nullopt);
    result.summary.init = filtered.summary.init;
    result.summary.pixel_error_before = filtered.summary.pixel_error_before;
    result.summary.pixel_error_after = filtered.summary.pixel_error_after;
  } else {
    result.summary.termination = context.IsCancelled()
                                     ? SolveTermination::kInterrupted
                                     : SolveTermination::kNothingToSolve;
  }
  result.model = std::move(filtered.model);
  result.outliers = std::move(filtered.summary);
  return result;
}

}  // namespace

TolerantSolveResult SolveTolerantly(const Model& model,
                                    const TolerantSolveOptions& options,
                                    const Context& context) {
  if (options.max_error) {
    return SolveWithoutOutliers(model, options, false, context);
  }
  SolveModelOptions solve = options.solve;
  const bool allows_removal = AllowsRemoval(solve);
  if (!allows_removal || solve.init != SolveInit::kFeasible ||
      solve.describe_certificate) {
    SolveModelResult solved = SolveModel(model, solve, context);
    if (!allows_removal ||
        solved.summary.termination != SolveTermination::kNothingToSolve) {
      return {std::move(solved.model), std::move(solved.summary), std::nullopt};
    }
  }
  TolerantSolveResult result =
      SolveWithoutOutliers(model, options, true, context);
  if (!result.outliers->is_spared) return result;
  // Perhaps all observations can stay: the lowest maximum tells.
  solve.init = SolveInit::kFeasible;
  SolveModelResult solved = SolveModel(model, solve, context);
  const SolveTermination ended = solved.summary.termination;
  const double explained = result.outliers->max_error;
  if (ended == SolveTermination::kNoStart ||
      ended == SolveTermination::kInfeasible ||
      (explained > 0 && solved.summary.lower_bound.value_or(0) > explained)) {
    return SolveWithoutOutliers(model, options, false, context);
  }
  return {std::move(solved.model), std::move(solved.summary), std::nullopt};
}

}  // namespace krot::internal
