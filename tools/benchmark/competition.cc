#include "tools/benchmark/competition.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <limits>

#include "tools/benchmark/timing.h"

namespace krot::internal {
namespace {

// One timed loop takes at least this long.
constexpr double kMinSeconds = 2e-3;

}  // namespace

std::vector<Standing> Compete(
    const std::vector<Subproblem>& instances, Norm norm,
    const std::vector<std::unique_ptr<SubproblemSolver>>& solvers,
    int repeats) {
  std::vector<std::vector<double>> costs;  // by solver and instance
  std::vector<double> lowest(instances.size(),
                             std::numeric_limits<double>::infinity());
  for (const auto& solver : solvers) {
    costs.emplace_back();
    const std::vector<Eigen::Vector3d> points = solver->MinimizeAll(instances);
    for (size_t i = 0; i < instances.size(); ++i) {
      costs.back().push_back(instances[i].Cost(points[i], norm));
      lowest[i] = std::min(lowest[i], costs.back()[i]);
    }
  }
  std::vector<std::function<void()>> runs;
  for (const auto& solver : solvers) {
    runs.emplace_back(
        [&instances, &solver] { solver->MinimizeAll(instances); });
  }
  const std::vector<double> seconds =
      TimeInterleaved(runs, repeats, kMinSeconds);
  const double count = static_cast<double>(instances.size());
  std::vector<Standing> standings;
  for (size_t s = 0; s < solvers.size(); ++s) {
    Standing standing;
    standing.name = solvers[s]->Name();
    standing.seconds = seconds[s] / count;
    for (size_t i = 0; i < instances.size(); ++i) {
      const double excess =
          (costs[s][i] - lowest[i]) / std::max(lowest[i], kSmallCost);
      standing.max_excess = std::max(standing.max_excess, excess);
      standing.mean_excess += excess / count;
    }
    standings.push_back(standing);
  }
  return standings;
}

std::vector<std::unique_ptr<SubproblemSolver>> AllSolvers(Norm norm) {
  std::vector<std::unique_ptr<SubproblemSolver>> solvers = OwnSolvers(norm);
  std::vector<std::unique_ptr<SubproblemSolver>> rivals = RivalSolvers(norm);
  std::move(rivals.begin(), rivals.end(), std::back_inserter(solvers));
  return solvers;
}

}  // namespace krot::internal
