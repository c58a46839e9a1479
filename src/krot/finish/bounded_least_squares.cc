#include "krot/finish/bounded_least_squares.h"

#include "krot/base/check.h"
#include "krot/finish/bounded_path.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

template <typename Cap>
BoundedSummary Run(const KnownRotationProblem& problem,
                   const BoundedOptions& options, const Context& context,
                   Estimate* estimate) {
  BoundedPath<Cap> path(problem, options, context, *estimate);
  const BoundedSummary summary = path.Run();
  *estimate = path.estimate();
  return summary;
}

}  // namespace

BoundedSummary MinimizeBounded(const KnownRotationProblem& problem,
                               const BoundedOptions& options,
                               const Context& context, Estimate* estimate) {
  CheckArgument(options.norm.p == 2 || options.norm.IsPolyhedral(), "norm.p",
                options.norm.p, "1, 2 or infinity");
  CheckArgument(options.cap > 0, "cap", options.cap, "> 0");
  CheckArgument(options.loss.scale > 0, "loss.scale", options.loss.scale,
                "> 0");
  CheckArgument(options.gap_tolerance > 0, "gap_tolerance",
                options.gap_tolerance, "> 0");
  CheckArgument(options.stationarity_tolerance > 0, "stationarity_tolerance",
                options.stationarity_tolerance, "> 0");
  CheckArgument(options.max_iterations >= 1, "max_iterations",
                options.max_iterations, ">= 1");
  const double cost =
      context.Max(Cost(problem, *estimate, options.norm, context.num_threads));
  CheckArgument(cost < options.cap, "cost of the start", cost, "below the cap");
  return options.norm.p == 2
             ? Run<DiscCap>(problem, options, context, estimate)
             : Run<PolygonCap>(problem, options, context, estimate);
}

int64_t EstimateBoundedMemory(const KnownRotationProblem& problem, Norm norm) {
  return norm.p == 2 ? BoundedPath<DiscCap>::MemoryBytes(problem)
                     : BoundedPath<PolygonCap>::MemoryBytes(problem);
}

}  // namespace krot
