#include "krot/outliers/tolerant_solve.h"

#include <utility>

namespace krot::internal {
namespace {

// Whether nothing came of a model without positions for want of a start that
// has them all.
bool NeedsRemoval(const SolveModelOptions& options,
                  const SolveSummary& summary) {
  return summary.termination == SolveTermination::kNothingToSolve &&
         !options.problem.fixed.Any() && options.problem.positions.empty() &&
         EffectiveMethod(options) == SolveMethod::kAuto && options.norm.p == 2;
}

TolerantSolveResult SolveWithoutOutliers(const Model& model,
                                         const TolerantSolveOptions& options,
                                         const Context& context) {
  OutlierFilterOptions filter;
  filter.max_error = options.max_error;
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
  if (options.max_error) return SolveWithoutOutliers(model, options, context);
  SolveModelResult solved = SolveModel(model, options.solve, context);
  if (NeedsRemoval(options.solve, solved.summary)) {
    return SolveWithoutOutliers(model, options, context);
  }
  return {std::move(solved.model), std::move(solved.summary), std::nullopt};
}

}  // namespace krot::internal
