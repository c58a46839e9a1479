#include "krot/outliers/optimum_without.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include "krot/base/timer.h"
#include "krot/bridge/built_part.h"
#include "krot/bridge/reprojection.h"
#include "krot/pipeline/rounds.h"
#include "krot/problem/subset.h"

namespace krot::internal {

OptimumWithout SolveWithout(const Model& model, const BuiltProblem& built,
                            const std::vector<int64_t>& removed,
                            const Estimate& start, Norm norm,
                            double relative_gap, const Context& context) {
  std::vector<int64_t> all(built.pixels.size());
  std::iota(all.begin(), all.end(), 0);
  std::vector<int64_t> kept;
  std::set_difference(all.begin(), all.end(), removed.begin(), removed.end(),
                      std::back_inserter(kept));
  const ProblemSubset subset(built.problem,
                             PruneUnconstrained(built.problem, kept));
  OptimumWithout optimum;
  optimum.estimate = start;
  BuiltProblem part = BuiltPart(built, subset, start);
  if (part.pixels.empty()) return optimum;
  const Reprojection reprojection(model, part);
  Estimate estimate = part.start;
  reprojection.TakeRows(estimate, context.num_threads, &part.problem);
  SolveModelOptions options;
  options.norm = norm;
  options.joint.relative_gap = relative_gap;
  SolveSummary summary;
  optimum.proof = SolveInRounds(model, options, SolveMethod::kJoint, context,
                                Timer(), &part, &estimate, &summary);
  optimum.max_error =
      reprojection.TrueCost(estimate, norm, context.num_threads);
  if (optimum.proof) {
    optimum.lower_bound =
        LowerUntilAccepted(model, part, norm, context, &*optimum.proof)
            .lower_bound;
    optimum.proof->rows = InWhole(subset, std::move(optimum.proof->rows));
  }
  subset.Replace(estimate, &optimum.estimate);
  return optimum;
}

}  // namespace krot::internal
