#include "krot/solver/joint.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "krot/base/check.h"
#include "krot/base/timer.h"
#include "krot/conic/interior_point.h"
#include "krot/problem/cost.h"
#include "krot/problem/restrict.h"
#include "krot/solver/feasible_start.h"

namespace krot {
namespace {

// A certificate is tried once the interior point's own gap is as small as the
// one asked for, and again whenever it has fallen by this factor.
constexpr double kGapBetweenCertificates = 0.3;
// Where rounding ends the interior point anyway.
constexpr double kSmallestGap = 1e-10;
// Iterations after which a start is given up if the gap is still large. Most
// models take 10 to 50 in all; a start whose points hug the boundary of the
// cones can hold the interior point back for hundreds.
constexpr int kIterationsPerStart = 60;
constexpr double kLargeGap = 0.1;
// A fresh start is looked for at these shares of the cost.
constexpr double kRestartShares[] = {0.25, 0.5, 0.75, 0.9, 0.97};
constexpr int kMaxRestarts = 4;
constexpr double kHopelessGap = 1e-2;

void CheckOptions(const JointOptions& options) {
  CheckArgument(options.norm.p == 2 || options.norm.IsPolyhedral(), "norm.p",
                options.norm.p, "1, 2 or infinity");
  CheckArgument(options.relative_gap > 0, "relative_gap", options.relative_gap,
                "> 0");
  CheckArgument(options.max_iterations >= 1, "max_iterations",
                options.max_iterations, ">= 1");
}

// A connected component on its way to its certified optimum.
class ComponentSolve {
 public:
  ComponentSolve(const KnownRotationProblem& problem,
                 const JointOptions& options, const Estimate& start)
      : problem_(problem), options_(options), estimate_(start) {
    cost_ = Cost(problem, start, options.norm, options.num_threads);
  }

  // `report` is called after every iteration with the interior point's gap.
  JointTermination Run(const std::function<void(double gap)>& report);

  const Estimate& estimate() const { return estimate_; }
  double cost() const { return cost_; }
  double lower_bound() const { return lower_bound_; }
  const std::optional<Certificate>& certificate() const { return certificate_; }

 private:
  bool IsGapReached() const {
    return cost_ - lower_bound_ <= options_.relative_gap * cost_;
  }
  InteriorPointTermination RunFromEstimate(
      const std::function<void(double gap)>& report);
  bool FindFreshStart();
  void TryCertificate(const ConicIterate& iterate);

  const KnownRotationProblem& problem_;
  const JointOptions& options_;
  Estimate estimate_;
  double cost_ = 0;
  double lower_bound_ = 0;
  std::optional<Certificate> certificate_;
  int iterations_ = 0;
};

void ComponentSolve::TryCertificate(const ConicIterate& iterate) {
  CertificateOptions options;
  options.sufficient_bound = (1 - options_.relative_gap) * cost_;
  options.num_threads = options_.num_threads;
  options.cancel = options_.cancel;
  std::optional<Certificate> certificate =
      MakeCertificate(problem_, options_.norm, *iterate.estimate, iterate.gamma,
                      *iterate.multipliers, options);
  if (!certificate) return;
  const CertificateCheck check =
      CheckCertificate(problem_, options_.norm, *certificate);
  if (check.is_accepted && check.proved_bound > lower_bound_) {
    lower_bound_ = check.proved_bound;
    certificate_ = std::move(certificate);
  }
}

InteriorPointTermination ComponentSolve::RunFromEstimate(
    const std::function<void(double gap)>& report) {
  InteriorPointOptions options;
  options.norm = options_.norm;
  options.max_iterations = options_.max_iterations - iterations_;
  options.smallest_gap = std::min(kSmallestGap, options_.relative_gap);
  options.num_threads = options_.num_threads;
  options.cancel = options_.cancel;
  double next_gap = options_.relative_gap;
  options.stop = [&](const ConicIterate& iterate) {
    ++iterations_;
    if (iterate.cost < cost_) {
      cost_ = iterate.cost;
      estimate_ = *iterate.estimate;
    }
    if (iterate.gap <= next_gap) {
      TryCertificate(iterate);
      next_gap = kGapBetweenCertificates * iterate.gap;
    }
    report(iterate.gap);
    return IsGapReached() || (iterate.iteration >= kIterationsPerStart &&
                              iterate.gap > kLargeGap);
  };
  std::vector<Multiplier> multipliers;
  Estimate last = estimate_;
  return MinimizeJointly(problem_, options, &last, &multipliers).termination;
}

// An estimate of lower cost, far from the boundary of the cones.
bool ComponentSolve::FindFreshStart() {
  FeasibleStartOptions options;
  options.norm = options_.norm;
  options.hopeless_gap = kHopelessGap;
  options.num_threads = options_.num_threads;
  options.cancel = options_.cancel;
  for (const double share : kRestartShares) {
    if (share * cost_ <= lower_bound_) continue;
    if (FindEstimateBelow(problem_, share * cost_, options, &estimate_,
                          &iterations_) ==
        InteriorPointTermination::kFeasible) {
      LowerByFeasibility(problem_, options, &estimate_, &iterations_);
      cost_ = Cost(problem_, estimate_, options_.norm, options_.num_threads);
      return true;
    }
  }
  return false;
}

JointTermination ComponentSolve::Run(
    const std::function<void(double gap)>& report) {
  if (!(cost_ > 0)) return JointTermination::kGapReached;
  for (int restart = 0; restart <= kMaxRestarts; ++restart) {
    const InteriorPointTermination termination = RunFromEstimate(report);
    if (IsGapReached()) return JointTermination::kGapReached;
    if (termination == InteriorPointTermination::kInterrupted) {
      return JointTermination::kInterrupted;
    }
    if (iterations_ >= options_.max_iterations) {
      return JointTermination::kMaxIterations;
    }
    const bool is_fresh = FindFreshStart();
    if (IsCancelled(options_.cancel)) return JointTermination::kInterrupted;
    if (!is_fresh) break;
    if (iterations_ >= options_.max_iterations) {
      return JointTermination::kMaxIterations;
    }
  }
  return JointTermination::kStalled;
}

}  // namespace

JointSummary SolveJoint(const KnownRotationProblem& problem,
                        const JointOptions& options, Estimate* estimate) {
  CheckOptions(options);
  const Timer timer;
  JointSummary summary;
  summary.cost_initial =
      Cost(problem, *estimate, options.norm, options.num_threads);
  CheckArgument(std::isfinite(summary.cost_initial), "cost of the start",
                summary.cost_initial, "finite: all depths positive");

  std::vector<int64_t> all(problem.observations.size());
  std::iota(all.begin(), all.end(), 0);
  const std::vector<std::vector<int64_t>> components =
      SplitIntoComponents(problem, all);
  summary.num_components = static_cast<int32_t>(components.size());
  summary.termination = JointTermination::kGapReached;
  double cost_of_solved = 0;
  for (const std::vector<int64_t>& observations : components) {
    const RestrictedProblem part = RestrictProblem(problem, observations);
    ComponentSolve solve(part.problem, options,
                         RestrictEstimate(part, *estimate));
    const JointTermination termination = solve.Run([&](double gap) {
      JointIteration iteration;
      iteration.cost = std::max(cost_of_solved, solve.cost());
      const double bound = std::max(summary.lower_bound, solve.lower_bound());
      if (bound > 0) iteration.lower_bound = bound;
      iteration.gap = gap;
      iteration.seconds = timer.Seconds();
      summary.iterations.push_back(iteration);
      if (options.callback) {
        options.callback(static_cast<int>(summary.iterations.size()),
                         iteration);
      }
    });
    ReplaceEstimate(part, solve.estimate(), estimate);
    cost_of_solved = std::max(cost_of_solved, solve.cost());
    if (solve.certificate() && solve.lower_bound() > summary.lower_bound) {
      summary.lower_bound = solve.lower_bound();
      summary.certificate = solve.certificate();
      for (CertifiedObservation& observation :
           summary.certificate->observations) {
        observation.observation = part.observation_of[observation.observation];
      }
    }
    if (termination != JointTermination::kGapReached) {
      summary.termination = termination;
    }
    if (termination == JointTermination::kInterrupted) break;
  }
  summary.cost_final =
      Cost(problem, *estimate, options.norm, options.num_threads);
  // A component that fell short matters only if it sets the maximum.
  if (summary.termination != JointTermination::kInterrupted &&
      summary.RelativeGap() <= options.relative_gap) {
    summary.termination = JointTermination::kGapReached;
  }
  return summary;
}

}  // namespace krot
