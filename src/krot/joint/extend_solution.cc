#include "krot/joint/extend_solution.h"

#include <cmath>
#include <utility>

#include "krot/problem/cost.h"
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

bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate) {
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  DescentGoal goal;
  goal.level = level;
  goal.sufficient = kSufficientShareOfLevel * level;
  blocks.SetGoal(goal);
  return std::isfinite(blocks.IntersectPoints(estimate));
}

bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate) {
  if (!PlacePoints(problem, norm, context, level, estimate)) return false;
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
