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
                                         const Context& context) {
  OutlierFilterOptions filter;
  filter.max_error = options.max_error;
  filter.spares_what_fits = !options.max_error;
  filter.find_conflicts = options.find_conflicts;
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
  if (options.max_error) return SolveWithoutOutliers(model, options, context);
  const bool allows_removal = AllowsRemoval(options.solve);
  if (allows_removal && options.solve.init == SolveInit::kFeasible &&
      !options.solve.describe_certificate) {
    TolerantSolveResult result = SolveWithoutOutliers(model, options, context);
    if (!result.outliers->is_spared) return result;
  }
  SolveModelResult solved = SolveModel(model, options.solve, context);
  if (allows_removal &&
      solved.summary.termination == SolveTermination::kNothingToSolve) {
    return SolveWithoutOutliers(model, options, context);
  }
  return {std::move(solved.model), std::move(solved.summary), std::nullopt};
}

}  // namespace krot::internal
