#include <optional>
#include <utility>

#include "krot/outliers/outlier_filter.h"

namespace krot::internal {
namespace {

// Whether observations may be removed if no start satisfies all.
bool AllowsRemoval(const SolveModelOptions& options) {
  return !options.problem.fixed.Any() && options.problem.positions.empty() &&
         EffectiveMethod(options) == SolveMethod::kAuto && options.norm.p == 2;
}

TolerantSolveResult SolveWithoutOutliers(const Model& model,
                                         const TolerantSolveOptions& options,
                                         OutlierFilterOptions::Spared spared,
                                         const Context& context) {
  OutlierFilterOptions filter = options;
  filter.spared = spared;
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
  using Spared = OutlierFilterOptions::Spared;
  if (options.max_error) {
    return SolveWithoutOutliers(model, options, Spared::kNothing, context);
  }
  SolveModelOptions solve = options.solve;
  const bool allows_removal = AllowsRemoval(solve);
  const bool is_from_nothing = solve.init == SolveInit::kFeasible;
  if (!allows_removal || !is_from_nothing) {
    SolveModelResult solved = SolveModel(model, solve, context);
    if (!allows_removal ||
        solved.summary.termination != SolveTermination::kNothingToSolve) {
      return {std::move(solved.model), std::move(solved.summary), std::nullopt};
    }
  }
  const bool keeps_all = is_from_nothing && solve.describe_certificate;
  TolerantSolveResult result = SolveWithoutOutliers(
      model, options,
      keeps_all ? Spared::kEverything : Spared::kWhatFitsItsPositions, context);
  if (!result.outliers->is_spared) return result;
  solve.init = SolveInit::kFeasible;
  solve.found_start = std::move(result.outliers->spared_start);
  SolveModelResult solved = SolveModel(model, solve, context);
  const SolveTermination ended = solved.summary.termination;
  if (!keeps_all && (ended == SolveTermination::kNoStart ||
                     ended == SolveTermination::kInfeasible)) {
    return SolveWithoutOutliers(model, options, Spared::kNothing, context);
  }
  return {std::move(solved.model), std::move(solved.summary), std::nullopt};
}

}  // namespace krot::internal
