#include "krot/solver/initializer.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "krot/base/check.h"
#include "krot/problem/cost.h"
#include "krot/problem/restrict.h"
#include "krot/solver/feasible_start.h"
#include "krot/solver/joint.h"

namespace krot {
namespace {

// To prove a bound infeasible, an estimate is sought at this many times the
// bound, and again, and its cost lowered to the optimum.
constexpr double kBoundGrowth = 10;
constexpr double kLargestBound = 1e7;  // pixels
// When lowering a start that already meets the bound is given up.
constexpr double kHopelessGap = 1e-2;

FeasibleStartOptions StartOptions(const InitializerOptions& options) {
  FeasibleStartOptions start;
  start.norm = options.norm;
  start.max_iterations = options.max_iterations;
  start.num_threads = options.num_threads;
  start.cancel = options.cancel;
  return start;
}

// Scales the estimate to a median depth of one.
void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate) {
  std::vector<double> depths;
  depths.reserve(problem.observations.size());
  for (const Observation& observation : problem.observations) {
    depths.push_back(ViewPoint(problem, observation, *estimate).depth);
  }
  const auto median =
      depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), median, depths.end());
  for (Eigen::Vector3d& t : estimate->translations) t /= *median;
  for (Eigen::Vector3d& s : estimate->points) s /= *median;
}

// Where no estimate of a component was found at the bound, its optimum decides:
// sought from an estimate that misses the bound, it proves that there is none,
// or meets the bound itself.
InitializerTermination DecideByOptimum(const RestrictedProblem& part,
                                       const InitializerOptions& options,
                                       Estimate* estimate,
                                       InitializerSummary* summary) {
  for (double bound = kBoundGrowth * options.max_error; bound <= kLargestBound;
       bound *= kBoundGrowth) {
    const InteriorPointTermination found =
        FindEstimateBelow(part.problem, bound, StartOptions(options), estimate,
                          &summary->iterations);
    if (found == InteriorPointTermination::kInterrupted) {
      return InitializerTermination::kInterrupted;
    }
    if (found != InteriorPointTermination::kFeasible) continue;
    JointOptions joint;
    joint.norm = options.norm;
    joint.max_iterations = options.max_iterations;
    joint.num_threads = options.num_threads;
    joint.cancel = options.cancel;
    const JointSummary optimum = SolveJoint(part.problem, joint, estimate);
    summary->iterations += static_cast<int>(optimum.iterations.size());
    summary->cost = optimum.cost_final;
    if (optimum.certificate && optimum.lower_bound > options.max_error) {
      summary->certificate = optimum.certificate;
      for (CertifiedObservation& o : summary->certificate->observations) {
        o.observation = part.observation_of[o.observation];
      }
      summary->lower_bound = optimum.lower_bound;
      return InitializerTermination::kInfeasible;
    }
    if (optimum.termination == JointTermination::kInterrupted) {
      return InitializerTermination::kInterrupted;
    }
    return optimum.cost_final < options.max_error
               ? InitializerTermination::kFeasible
               : InitializerTermination::kFailed;
  }
  return InitializerTermination::kFailed;
}

}  // namespace

InitializerSummary FindStart(const KnownRotationProblem& problem,
                             const InitializerOptions& options,
                             Estimate* estimate) {
  CheckArgument(options.max_error > 0, "max_error", options.max_error, "> 0");
  InitializerSummary summary;
  Estimate found = *estimate;
  found.translations.resize(problem.num_frames, Eigen::Vector3d::Zero());
  found.points.resize(problem.num_points, Eigen::Vector3d::Zero());
  std::vector<int64_t> all(problem.observations.size());
  std::iota(all.begin(), all.end(), 0);
  for (const std::vector<int64_t>& observations :
       SplitIntoComponents(problem, all)) {
    const RestrictedProblem part = RestrictProblem(problem, observations);
    Estimate start;
    const InteriorPointTermination termination =
        FindEstimateBelow(part.problem, options.max_error,
                          StartOptions(options), &start, &summary.iterations);
    if (termination == InteriorPointTermination::kInterrupted) {
      summary.termination = InitializerTermination::kInterrupted;
      return summary;
    }
    if (termination != InteriorPointTermination::kFeasible) {
      summary.termination = DecideByOptimum(part, options, &start, &summary);
      if (summary.termination != InitializerTermination::kFeasible) {
        return summary;
      }
    }
    FeasibleStartOptions lower = StartOptions(options);
    lower.hopeless_gap = kHopelessGap;
    LowerByFeasibility(part.problem, lower, &start, &summary.iterations);
    if (!HasBaseline(part.problem)) NormalizeScale(part.problem, &start);
    ReplaceEstimate(part, start, &found);
  }
  summary.termination = InitializerTermination::kFeasible;
  summary.cost = Cost(problem, found, options.norm, options.num_threads);
  *estimate = std::move(found);
  return summary;
}

}  // namespace krot
