#include "krot/joint/feasible_start.h"

#include <algorithm>
#include <vector>

#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {
namespace {

// Of the longest baseline or distance of fixed positions: a depth that is small
// against the scene. Without either there is no scale, and any depth will do.
constexpr double kUnitDepthPerBaseline = 1e-2;
constexpr double kShare = 0.25;

double UnitDepth(const KnownRotationProblem& problem) {
  double longest = FixedExtent(problem);
  for (const View& view : problem.views) {
    longest = std::max(longest, view.cam_from_rig_translation.norm());
  }
  return longest > 0 ? kUnitDepthPerBaseline * longest : 1;
}

}  // namespace

InteriorPointTermination FindEstimateBelow(
    const KnownRotationProblem& problem, double bound,
    const FeasibleStartOptions& options, const Context& context,
    Estimate* estimate, std::vector<Multiplier>* multipliers) {
  InteriorPointOptions conic;
  conic.norm = options.norm;
  conic.max_iterations = options.max_iterations;
  conic.stop = [&](const ConicIterate& iterate) {
    if (options.callback) options.callback(bound);
    return iterate.gamma > 1 && iterate.gap < options.hopeless_gap;
  };
  return FindFeasible(problem, conic, context, bound,
                      options.unit_depth.value_or(UnitDepth(problem)), estimate,
                      multipliers)
      .termination;
}

bool LowerByFeasibility(const KnownRotationProblem& problem,
                        const FeasibleStartOptions& options,
                        const Context& context, Estimate* estimate) {
  bool is_lower = false;
  std::vector<Multiplier> multipliers;
  for (;;) {
    const double cost =
        Cost(problem, *estimate, options.norm, context.num_threads);
    if (!(kShare * cost > options.known_bound) ||
        FindEstimateBelow(problem, kShare * cost, options, context, estimate,
                          &multipliers) !=
            InteriorPointTermination::kFeasible) {
      return is_lower;
    }
    is_lower = true;
  }
}

}  // namespace krot
