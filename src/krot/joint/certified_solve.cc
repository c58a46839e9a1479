#include "krot/joint/component_solve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// Whether a proof is worth while is asked when the interior point's own gap is
// this small, and again whenever it has fallen by the factor below.
constexpr double kFirstGapToAsk = 0.1;
constexpr double kGapBetweenQuestions = 0.1;
// A certificate is tried once the interior point's own gap is as small as the
// one asked for, and again whenever it has fallen by this factor.
constexpr double kGapBetweenCertificates = 0.3;
// Of the gap asked for, where the interior point has gone far enough: what is
// not proved there is none of its optimum's.
constexpr double kFarBelow = 1e-2;
// Iterations after which a start is given up if the gap is still large. Most
// models take 10 to 50 in all; a start whose points hug the boundary of the
// cones can hold the interior point back for hundreds.
constexpr int kIterationsPerStart = 60;
constexpr double kLargeGap = 0.1;
// So many iterations must halve the gap, or the start is given up.
constexpr int kPatience = 30;
constexpr int kWarmPatience = 15;
// A fresh start is found by bisection, to this width, relative to the cost; if
// that was in vain, to a share of it.
constexpr double kFirstWidth = 1e-2;
constexpr double kShareOfWidth = 0.25;
constexpr double kStartMargin = 0.1;
constexpr double kWarmMarginOfDistance = 0.06;
constexpr double kLargestWarmMargin = 3e-3;
constexpr double kLeastWarmMargin = 1e-3;
// Where the known optimum is another problem's: that of another component, or
// of positions' rows at another level.
constexpr double kFarFromKnown = 0.5;
constexpr double kFarMargin = 0.03;
// Of an estimate that is found near the cost, and of the start from it.
constexpr double kFreshStartMargin = 1e-3;
// Smaller depths, of the median, are those of points in a camera.
constexpr double kDepthInCamera = 1e-6;
// In the unit of depth, of the median.
constexpr double kUnitDepth = 0.1;
constexpr double kHopelessGap = 1e-5;
// Whether there is anything below the cost is asked at this share of the gap
// that is to be shown.
constexpr double kShareOfGapBelow = 0.5;
// What is lost of a bound when it is proved, at most, relative.
constexpr double kProofLoss = 1e-3;

CertificateOptions Sufficient(double bound) {
  CertificateOptions options;
  options.sufficient_bound = bound;
  return options;
}

}  // namespace

bool HasPointsInCameras(const KnownRotationProblem& problem,
                        const Estimate& estimate) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Observation& observation : problem.observations) {
    smallest =
        std::min(smallest, ViewPoint(problem, observation, estimate).depth);
  }
  return smallest < kDepthInCamera * MedianDepth(problem, estimate);
}

CertifiedSolve::CertifiedSolve(const KnownRotationProblem& problem,
                               const JointOptions& options,
                               const Context& context, const Estimate& start,
                               double known_bound,
                               std::vector<Multiplier> known_multipliers,
                               double known_optimum)
    : problem_(problem),
      options_(options),
      context_(context),
      estimate_(start),
      cost_(Cost(problem, start, options.norm, context.num_threads)),
      lower_bound_(known_bound),
      multipliers_(std::move(known_multipliers)),
      are_multipliers_known_(!multipliers_.empty()),
      known_optimum_(known_optimum) {}

// The more, the farther the start seems to be from its optimum.
double CertifiedSolve::WarmMargin() const {
  const double distance = std::abs(1 - known_optimum_ / cost_);
  if (distance > kFarFromKnown) return kFarMargin;
  return std::clamp(kWarmMarginOfDistance * distance, kLeastWarmMargin,
                    kLargestWarmMargin);
}

void CertifiedSolve::Adopt(std::optional<Certificate> certificate) {
  if (!certificate) return;
  const CertificateCheck check =
      CheckCertificate(problem_, options_.norm, *certificate);
  if (check.is_accepted && check.proved_bound > lower_bound_) {
    lower_bound_ = check.proved_bound;
    certificate_ = std::move(certificate);
  }
}

InteriorPointTermination CertifiedSolve::RunFrom(
    Estimate start, double start_margin, const TakeEstimate& take,
    const IterationReport& report) {
  InteriorPointOptions options;
  options.norm = options_.norm;
  options.start_margin = start_margin;
  if (are_multipliers_known_) options.known_multipliers = &multipliers_;
  const int patience = are_multipliers_known_ ? kWarmPatience : kPatience;
  options.max_iterations = std::max(1, max_iterations_ - iterations_);
  options.smallest_gap = kFarBelow * options_.relative_gap;
  double next_gap = options_.relative_gap;
  double gap_to_ask = kFirstGapToAsk;
  double milestone = std::numeric_limits<double>::infinity();
  int milestone_iteration = 0;
  options.stop = [&](const ConicIterate& iterate) {
    ++iterations_;
    if (iterate.cost < cost_) {
      cost_ = iterate.cost;
      estimate_ = *iterate.estimate;
    }
    if (iterate.gap <= std::max(next_gap, gap_to_ask)) {
      is_given_up_ = !take(estimate_);
      while (gap_to_ask >= iterate.gap) gap_to_ask *= kGapBetweenQuestions;
    }
    if (iterate.gap <= next_gap && !is_given_up_) {
      Adopt(MakeCertificate(problem_, options_.norm, *iterate.estimate,
                            iterate.gamma, *iterate.multipliers,
                            Sufficient((1 - options_.relative_gap) * cost_),
                            context_));
      next_gap = kGapBetweenCertificates * iterate.gap;
    }
    gap_ = iterate.gap;
    if (gap_ < milestone / 2) {
      milestone = gap_;
      milestone_iteration = iterate.iteration;
    }
    JointIteration iteration;
    iteration.gap = gap_;
    report(iteration);
    return is_given_up_ || IsGapReached() ||
           iterate.iteration >= milestone_iteration + patience ||
           (iterate.iteration >= kIterationsPerStart &&
            iterate.gap > kLargeGap);
  };
  return MinimizeJointly(problem_, options, context_, &start, &multipliers_)
      .termination;
}

FeasibleStartOptions CertifiedSolve::OptionsForStart(
    const IterationReport& report) {
  FeasibleStartOptions options;
  options.norm = options_.norm;
  options.unit_depth = kUnitDepth * MedianDepth(problem_, estimate_);
  options.known_bound = lower_bound_;
  options.hopeless_gap = kHopelessGap;
  options.callback = [this, &report](double target) {
    ++iterations_;
    JointIteration iteration;
    iteration.target = target;
    report(iteration);
  };
  return options;
}

// Where a point lies in a camera, coordinates do not resolve its depth and its
// multipliers are as large as the depth is small: the interior point would
// settle far from balance. An estimate from the middle of the cones, where
// points and cameras have come apart, takes its place, be it a little worse.
// Whether there is one.
bool CertifiedSolve::LeaveCameras(const IterationReport& report,
                                  Estimate* start) {
  if (!HasPointsInCameras(problem_, *start)) return false;
  std::vector<Multiplier> multipliers;
  return FindEstimateBelow(problem_, (1 + kFreshStartMargin) * cost_,
                           OptionsForStart(report), context_, start,
                           &multipliers) == InteriorPointTermination::kFeasible;
}

// Either an estimate below `bound`, pixels, far from the boundary of the cones,
// which becomes the best; or a proof, if all goes well, that there is none.
bool CertifiedSolve::TryBelow(double bound, const IterationReport& report) {
  const FeasibleStartOptions options = OptionsForStart(report);
  std::vector<Multiplier> multipliers;
  if (FindEstimateBelow(problem_, bound, options, context_, &estimate_,
                        &multipliers) == InteriorPointTermination::kFeasible) {
    LowerByFeasibility(problem_, options, context_, &estimate_);
    cost_ = Cost(problem_, estimate_, options_.norm, context_.num_threads);
    return true;
  }
  const double sufficient =
      std::min((1 - kProofLoss) * bound, (1 - options_.relative_gap) * cost_);
  Adopt(MakeInfeasibilityCertificate(problem_, options_.norm, bound,
                                     multipliers, Sufficient(sufficient),
                                     context_));
  return false;
}

// Brings cost and what is known to be infeasible together. Whether there is a
// new estimate.
bool CertifiedSolve::Bisect(double width, const IterationReport& report) {
  bool is_fresh = false;
  double infeasible = lower_bound_;
  while (cost_ - infeasible > width * cost_ && !IsGapReached() &&
         iterations_ < max_iterations_ && !context_.IsCancelled()) {
    const double bound = (infeasible + cost_) / 2;
    if (TryBelow(bound, report)) {
      is_fresh = true;
    } else {
      infeasible = std::max(bound, lower_bound_);
    }
  }
  return is_fresh;
}

// Whether there is a new estimate. One just below the cost is sought first, or
// the proof that there is none: cost and what is known to be infeasible are
// only brought together where neither is found, or where the last such estimate
// led hardly lower.
bool CertifiedSolve::FindFreshStart(const IterationReport& report) {
  const bool has_led_lower = cost_ < (1 - width_) * fresh_cost_;
  if (has_led_lower &&
      TryBelow((1 - kShareOfGapBelow * options_.relative_gap) * cost_,
               report)) {
    fresh_cost_ = cost_;
    return true;
  }
  if (IsGapReached()) return false;
  const bool is_fresh = Bisect(width_, report);
  width_ *= kShareOfWidth;
  fresh_cost_ = std::numeric_limits<double>::infinity();
  return is_fresh;
}

JointTermination CertifiedSolve::Run(int max_iterations,
                                     const TakeEstimate& take,
                                     const IterationReport& report) {
  max_iterations_ = max_iterations;
  width_ = kFirstWidth;
  fresh_cost_ = std::numeric_limits<double>::infinity();
  if (IsLowEnough()) return JointTermination::kGapReached;
  double start_margin = are_multipliers_known_ ? WarmMargin() : kStartMargin;
  Estimate start = estimate_;
  if (LeaveCameras(report, &start)) start_margin = kFreshStartMargin;
  for (;;) {
    const InteriorPointTermination termination =
        RunFrom(start, start_margin, take, report);
    if (IsGapReached()) return JointTermination::kGapReached;
    if (is_given_up_) return JointTermination::kStalled;
    if (termination == InteriorPointTermination::kInterrupted) {
      return JointTermination::kInterrupted;
    }
    if (iterations_ >= max_iterations_) {
      return JointTermination::kMaxIterations;
    }
    if (std::exchange(are_multipliers_known_, false) && gap_ > kLargeGap) {
      start_margin = kStartMargin;  // again, as if nothing were known
      continue;
    }
    start_margin = kFreshStartMargin;
    const bool is_fresh = FindFreshStart(report);
    if (IsGapReached()) return JointTermination::kGapReached;
    if (context_.IsCancelled()) return JointTermination::kInterrupted;
    if (iterations_ >= max_iterations_) {
      return JointTermination::kMaxIterations;
    }
    if (!is_fresh) return JointTermination::kStalled;
    start = estimate_;
  }
}

}  // namespace krot::internal
