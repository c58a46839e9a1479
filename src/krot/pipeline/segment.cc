#include "krot/pipeline/segment.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

// Steps tried: 1, then shorter ones by this factor, until they get worse.
constexpr double kShorter = 0.7;
constexpr double kShortestStep = 1e-3;

}  // namespace

Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, const Context& context,
                       double* step) {
  const auto cost_of = [&](const Estimate& estimate) {
    return MaxOfRanks(context, reprojection.LevelledCost(estimate, norm,
                                                         context.num_threads));
  };
  Estimate best = from;
  double best_cost = cost_of(from);
  *step = 0;
  for (double trial = 1; trial >= kShortestStep; trial *= kShorter) {
    Estimate candidate = trial == 1 ? to : Between(from, to, trial);
    const double cost = cost_of(candidate);
    if (cost < best_cost) {
      best = std::move(candidate);
      best_cost = cost;
      *step = trial;
    } else if (*step > 0) {
      break;
    }
  }
  return best;
}

Estimate BestPointsOnSegments(const Reprojection& reprojection,
                              const KnownRotationProblem& problem,
                              const Estimate& from, const Estimate& to,
                              Norm norm, int num_threads) {
  Estimate best = to;
  const auto cost_of = [&](int64_t k) {
    double cost = 0;
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      cost = std::max(cost, reprojection.Error(best, norm, i));
    }
    return cost;
  };
  ParallelForEach(problem.num_points, num_threads, [&](int64_t k) {
    best.points[k] = from.points[k];
    const double before = cost_of(k);
    double step = 1;
    do {
      best.points[k] =
          step == 1 ? to.points[k]
                    : from.points[k] + step * (to.points[k] - from.points[k]);
      step *= kShorter;
    } while (cost_of(k) > before && step >= kShortestStep);
    if (cost_of(k) > before) best.points[k] = from.points[k];
  });
  return best;
}

}  // namespace krot::internal
