#include "krot/joint/joint.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/joint/component_solve.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

bool HasSmallerName(const CertifiedObservation& a,
                    const CertifiedObservation& b) {
  return a.observation < b.observation;
}

}  // namespace

void KnownMultipliers::Keep(const std::vector<int64_t>& names,
                            const std::vector<Multiplier>& multipliers,
                            double optimum) {
  optimum_ = {optimum};
  std::vector<CertifiedObservation> kept(names.size());
  for (size_t i = 0; i < names.size(); ++i) {
    kept[i] = {names[i], multipliers[i].lambda, multipliers[i].y};
  }
  std::vector<CertifiedObservation> all;
  all.reserve(kept.size() + known_.size());
  // If both ranges have the same name, set_union takes the first range's.
  std::set_union(kept.begin(), kept.end(), known_.begin(), known_.end(),
                 std::back_inserter(all), HasSmallerName);
  known_ = std::move(all);
}

std::vector<Multiplier> KnownMultipliers::Of(
    const std::vector<int64_t>& names) const {
  std::vector<Multiplier> multipliers;
  auto next = known_.begin();
  for (size_t i = 0; i < names.size() && next != known_.end(); ++i) {
    while (next != known_.end() && next->observation < names[i]) ++next;
    if (next == known_.end() || next->observation != names[i]) continue;
    multipliers.resize(names.size());
    multipliers[i] = {next->lambda, next->y};
  }
  return multipliers;
}

namespace {

void CheckOptions(const JointOptions& options) {
  CheckConic(options.norm);
  CheckPositive(options.relative_gap, "relative_gap");
  CheckAtLeast(0, options.sufficient_cost, "sufficient_cost");
  CheckAtLeast(1, options.max_iterations, "max_iterations");
}

}  // namespace

JointSummary SolveJoint(const KnownRotationProblem& problem,
                        const JointOptions& options, const Context& context,
                        Estimate* estimate, KnownMultipliers* known) {
  CheckOptions(options);
  const Timer timer;
  JointSummary summary;
  const auto cost_of = [&](const Estimate& x) {
    return MaxOfRanks(context,
                      Cost(problem, x, options.norm, context.num_threads));
  };
  summary.cost_initial = cost_of(*estimate);
  CheckArgument(std::isfinite(summary.cost_initial), "cost of the start",
                summary.cost_initial, "finite: all depths positive");

  if (context.ranks != nullptr && FindComponents(problem, context).count > 1) {
    RequireOneRank(context, "a model in several components");
  }
  std::vector<std::vector<int64_t>> components =
      context.ranks == nullptr ? SplitIntoComponents(problem)
                               : std::vector<std::vector<int64_t>>(1);
  summary.num_components = static_cast<int32_t>(components.size());
  summary.termination = JointTermination::kGapReached;
  double cost_of_solved = 0;
  for (std::vector<int64_t>& observations : components) {
    const ProblemSubset part =
        context.ranks == nullptr
            ? ProblemSubset(problem, std::move(observations))
            : ProblemSubset(problem);
    KnownMultipliers own;
    const bool is_one = summary.num_components == 1;
    ComponentSolve solve(part.problem(), options, context,
                         part.Restrict(*estimate),
                         known != nullptr && is_one ? known : &own);
    const JointTermination termination =
        solve.Run([&](JointIteration iteration) {
          iteration.cost = std::max(cost_of_solved, *iteration.cost);
          const double bound =
              std::max(summary.lower_bound, iteration.lower_bound.value_or(0));
          if (bound > 0) iteration.lower_bound = bound;
          iteration.seconds = timer.Seconds();
          summary.iterations.push_back(iteration);
          if (options.callback) {
            options.callback(static_cast<int>(summary.iterations.size()),
                             iteration);
          }
        });
    part.Replace(solve.estimate(), estimate);
    cost_of_solved = std::max(cost_of_solved, solve.cost());
    summary.num_working_observations += solve.num_working_observations();
    if (solve.certificate() && solve.lower_bound() > summary.lower_bound) {
      summary.lower_bound = solve.lower_bound();
      summary.certificate = InWhole(part, *solve.certificate());
    }
    if (termination != JointTermination::kGapReached) {
      summary.termination = termination;
    }
    if (termination == JointTermination::kInterrupted) break;
  }
  summary.cost_final = cost_of(*estimate);
  // A component that did not reach the gap matters only if it sets the maximum.
  if (summary.termination != JointTermination::kInterrupted &&
      summary.RelativeGap() <= options.relative_gap) {
    summary.termination = JointTermination::kGapReached;
  }
  return summary;
}

}  // namespace krot::internal
