#include "krot/solver/certified_solve.h"

#include <algorithm>
#include <utility>

#include "krot/conic/interior_point.h"
#include "krot/problem/cost.h"
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

}  // namespace

CertifiedSolve::CertifiedSolve(const KnownRotationProblem& problem,
                               const JointOptions& options,
                               const Estimate& start)
    : problem_(problem),
      options_(options),
      estimate_(start),
      cost_(Cost(problem, start, options.norm, options.num_threads)) {}

void CertifiedSolve::TryCertificate(const ConicIterate& iterate) {
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

InteriorPointTermination CertifiedSolve::RunFromEstimate(
    const IsWorthProving& is_worth_proving, const IterationReport& report) {
  InteriorPointOptions options;
  options.norm = options_.norm;
  options.max_iterations = max_iterations_ - iterations_;
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
      is_given_up_ = !is_worth_proving(estimate_, cost_);
      if (!is_given_up_) TryCertificate(iterate);
      next_gap = kGapBetweenCertificates * iterate.gap;
    }
    JointIteration iteration;
    iteration.gap = iterate.gap;
    report(iteration);
    return is_given_up_ || IsGapReached() ||
           (iterate.iteration >= kIterationsPerStart &&
            iterate.gap > kLargeGap);
  };
  std::vector<Multiplier> multipliers;
  Estimate last = estimate_;
  return MinimizeJointly(problem_, options, &last, &multipliers).termination;
}

// An estimate of lower cost, far from the boundary of the cones.
bool CertifiedSolve::FindFreshStart(const IterationReport& report) {
  FeasibleStartOptions options;
  options.norm = options_.norm;
  options.hopeless_gap = kHopelessGap;
  options.num_threads = options_.num_threads;
  options.cancel = options_.cancel;
  options.callback = [&](double target) {
    ++iterations_;
    JointIteration iteration;
    iteration.target = target;
    report(iteration);
  };
  for (const double share : kRestartShares) {
    if (share * cost_ <= lower_bound_) continue;
    if (FindEstimateBelow(problem_, share * cost_, options, &estimate_) ==
        InteriorPointTermination::kFeasible) {
      LowerByFeasibility(problem_, options, &estimate_);
      cost_ = Cost(problem_, estimate_, options_.norm, options_.num_threads);
      return true;
    }
  }
  return false;
}

JointTermination CertifiedSolve::Run(int max_iterations,
                                     const IsWorthProving& is_worth_proving,
                                     const IterationReport& report) {
  max_iterations_ = max_iterations;
  if (!(cost_ > 0)) return JointTermination::kGapReached;
  for (int restart = 0; restart <= kMaxRestarts; ++restart) {
    const InteriorPointTermination termination =
        RunFromEstimate(is_worth_proving, report);
    if (IsGapReached()) return JointTermination::kGapReached;
    if (is_given_up_) return JointTermination::kStalled;
    if (termination == InteriorPointTermination::kInterrupted) {
      return JointTermination::kInterrupted;
    }
    if (iterations_ >= max_iterations_) {
      return JointTermination::kMaxIterations;
    }
    const bool is_fresh = FindFreshStart(report);
    if (IsCancelled(options_.cancel)) return JointTermination::kInterrupted;
    if (!is_fresh) break;
    if (iterations_ >= max_iterations_) {
      return JointTermination::kMaxIterations;
    }
  }
  return JointTermination::kStalled;
}

}  // namespace krot
