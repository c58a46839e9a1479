#include "krot/conic/excess_program.h"

#include <algorithm>

#include "krot/base/check.h"
#include "krot/conic/excess_solver.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

// Smaller depths than this share of the median count as much in the costs.
constexpr double kSmallestDepthInCosts = 0.1;

// The depths at the start, those that are not positive or small raised; all 1
// if most are not positive.
std::vector<double> DepthsForCosts(const KnownRotationProblem& problem,
                                   const Estimate& start, bool* has_depths) {
  std::vector<double> depths;
  depths.reserve(problem.observations.size());
  for (const Observation& o : problem.observations) {
    depths.push_back(ViewPoint(problem, o, start).depth);
  }
  std::vector<double> sorted = depths;
  const auto middle =
      sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  *has_depths = *middle > 0;
  for (double& depth : depths) {
    depth = *has_depths ? std::max(depth, kSmallestDepthInCosts * *middle) : 1;
  }
  return depths;
}

}  // namespace

ExcessSolution MinimizeExcess(const KnownRotationProblem& problem, double bound,
                              const ExcessOptions& options,
                              const Context& context, Estimate* estimate) {
  CheckArgument(options.norm.p == 2 || options.norm.IsPolyhedral(), "norm.p",
                options.norm.p, "1, 2 or infinity");
  CheckArgument(bound > 0, "bound", bound, "> 0");
  CheckArgument(options.smallest_mu > 0, "smallest_mu", options.smallest_mu,
                "> 0");
  CheckArgument(options.weights.empty() ||
                    options.weights.size() == problem.observations.size(),
                "weights.size()", options.weights.size(),
                "0 or the number of observations");
  bool has_depths = false;
  const std::vector<double> depths =
      DepthsForCosts(problem, *estimate, &has_depths);
  if (!has_depths) {
    for (Eigen::Vector3d& t : estimate->translations) t.setZero();
    for (Eigen::Vector3d& s : estimate->points) s.setZero();
  }
  if (options.norm.p == 2) {
    return ExcessSolver<SecondOrderCone>(problem, bound, options, context,
                                         *estimate, depths, has_depths)
        .Run(estimate);
  }
  return ExcessSolver<FourHalfLines>(problem, bound, options, context,
                                     *estimate, depths, has_depths)
      .Run(estimate);
}

}  // namespace krot
