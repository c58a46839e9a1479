#include "krot/joint/extend_solution.h"

#include <cmath>
#include <utility>
#include <vector>

#include "krot/problem/cost.h"
#include "krot/problem/subset.h"
#include "krot/sweeps/block_sweep.h"

namespace krot {
namespace {

// A point that is to fit in need not go further below the level: less than what
// would have the working set take it in (component_solve.cc).
constexpr double kSufficientShareOfLevel = 0.7;
// Sweeps move the blocks above this share of the highest cost allowed, as far
// as this tolerance. They end with the one that leaves more than that share of
// the excess.
constexpr double kShareOfHighest = 0.9;
constexpr double kSweepTolerance = 1e-3;
constexpr double kExcessLeft = 0.8;
constexpr int kMaxSweeps = 10;

}  // namespace

bool PlaceOthers(const KnownRotationProblem& problem, const WorkingSet& set,
                 Norm norm, const Context& context, double level,
                 Estimate* estimate) {
  std::vector<int64_t> observations;
  bool is_behind = false;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (set.Contains(k)) continue;
    const double cost = PointCost(problem, *estimate, norm, k);
    is_behind |= !std::isfinite(cost);
    if (cost <= level || !std::isfinite(cost)) continue;
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      observations.push_back(i);
    }
  }
  if (!observations.empty()) {
    const ProblemSubset part(problem, std::move(observations));
    Estimate placed = part.Restrict(*estimate);
    BlockSweep blocks(part.problem(), FastDescentOptions(), norm,
                      context.Alone());
    DescentGoal goal;
    goal.sufficient = kSufficientShareOfLevel * level;
    blocks.SetGoal(goal);
    blocks.IntersectPoints(&placed);
    part.Replace(placed, estimate);
  }
  return !context.Any(is_behind);
}

bool ExtendSolution(const KnownRotationProblem& problem, const WorkingSet& set,
                    Norm norm, const Context& context, double level,
                    double highest, Estimate* estimate) {
  if (!PlaceOthers(problem, set, norm, context, level, estimate)) return false;
  const auto excess = [&] {
    return context.Max(Cost(problem, *estimate, norm, context.num_threads)) -
           highest;
  };
  double left = excess();
  if (left <= 0) return true;
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  blocks.SetGoal({kSweepTolerance, kShareOfHighest * highest});
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    blocks.ResectFrames(estimate);
    blocks.IntersectPoints(estimate);
    const double before = std::exchange(left, excess());
    if (left <= 0) return true;
    if (left > kExcessLeft * before) return false;
  }
  return false;
}

}  // namespace krot
