#include "krot/outliers/tolerant_solve.h"

#include <utility>

namespace krot::internal {
namespace {

// Whether observations may go where no start has them all.
bool AllowsRemoval(const SolveModelOptions& options) {
  return !options.problem.fixed.Any() && options.problem.positions.empty() &&
         EffectiveMethod(options) == SolveMethod::kAuto && options.norm.p == 2;
}

TolerantSolveResult SolveWithoutOutliers(const Model& model,
                                         const TolerantSolveOptions& options,
                                         bool spares_what_fits,
                                         const Context& context) {
  OutlierFilterOptions filter;
  filter.max_error = options.max_error;
  filter.spares_what_fits = spares_what_fits;
  filter.find_conflicts = options.find_conflicts;
  filter.has_start_from_nothing = options.has_start_from_nothing;
  filter.solve = options.solve;
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
