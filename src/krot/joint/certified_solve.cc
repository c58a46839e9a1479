#include "krot/joint/component_solve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/conic/interior_point.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// The interior point's relative gap above which it is far from its optimum.
constexpr double kLargeGap = 0.1;
// The start margin from a fresh start. It is also how far above the cost an
// estimate may be that is to replace one with tiny parts.
constexpr double kFreshStartMargin = 1e-3;

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
  return smallest < 1e-6 * MedianDepth(problem, estimate);
}

bool HasTinyParts(const KnownRotationProblem& problem,
                  const Estimate& estimate) {
  std::vector<double> depths;
  std::vector<int32_t> frame_of;
  for (const Observation& observation : problem.observations) {
    depths.push_back(ViewPoint(problem, observation, estimate).depth);
    frame_of.push_back(problem.views[observation.view].frame);
  }
  const std::vector<double> medians =
      GroupMedians(depths, frame_of, problem.num_frames, Context());
  double smallest = std::numeric_limits<double>::infinity();
  double largest = 0;
  for (const double median : medians) {
    if (!(median > 0)) continue;
    smallest = std::min(smallest, median);
    largest = std::max(largest, median);
  }
  return smallest < 1e-5 * largest;
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

// The start margin of a warm start: the farther the start seems to be from its
// optimum, the more. A known optimum that is very far from the cost is that of
// another problem: of another component, or of positions' rows at another
// level.
double CertifiedSolve::WarmMargin() const {
  const double distance = std::abs(1 - known_optimum_ / cost_);
  if (distance > 0.5) return 0.03;
  return std::clamp(0.06 * distance, 1e-3, 3e-3);
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

// Runs the interior point. `take` is called when its own gap is a tenth, and
// again whenever it has fallen by ten. A certificate is tried once the gap is
// as small as the one asked for, and again whenever it has fallen to 0.3 of
// that. The run ends far below: there, a missing proof is not its fault.
//
// The start is given up if the gap does not halve within some iterations, or is
// still large after many. Most models take 10 to 50 in all; a start whose
// points hug the boundary of the cones can hold the interior point back for
// hundreds.
InteriorPointTermination CertifiedSolve::RunFrom(
    Estimate start, double start_margin, const TakeEstimate& take,
    const IterationReport& report) {
  InteriorPointOptions options;
  options.norm = options_.norm;
  options.start_margin = start_margin;
  if (are_multipliers_known_) options.known_multipliers = &multipliers_;
  const int patience = are_multipliers_known_ ? 15 : 30;
  options.max_iterations = std::max(1, max_iterations_ - iterations_);
  options.smallest_gap = 1e-2 * options_.relative_gap;
  double next_gap = options_.relative_gap;
  double gap_to_ask = 0.1;
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
      while (gap_to_ask >= iterate.gap) gap_to_ask *= 0.1;
    }
    if (iterate.gap <= next_gap && !is_given_up_) {
      Adopt(MakeCertificate(problem_, options_.norm, *iterate.estimate,
                            iterate.gamma, *iterate.multipliers,
                            Sufficient((1 - options_.relative_gap) * cost_),
                            context_));
      next_gap = 0.3 * iterate.gap;
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
           (iterate.iteration >= 60 && iterate.gap > kLargeGap);
  };
  return MinimizeJointly(problem_, options, context_, &start, &multipliers_)
      .termination;
}

FeasibleStartOptions CertifiedSolve::OptionsForStart(
    const IterationReport& report) {
  FeasibleStartOptions options;
  options.norm = options_.norm;
  options.unit_depth = 0.1 * MedianDepth(problem_, estimate_);
  options.known_bound = lower_bound_;
  options.hopeless_gap = 1e-5;
  options.callback = [this, &report](double target) {
    ++iterations_;
    JointIteration iteration;
    iteration.target = target;
    report(iteration);
  };
  return options;
}

// Parts that only weak links hold together may differ in scale by orders of
// magnitude. The barrier draws all depths towards their mean, and from such a
// start that takes hundreds of iterations. So it is replaced by one that is
// found from nothing, where all parts are of a size, even if that is slightly
// worse. Returns whether the start was replaced.
bool CertifiedSolve::EvenOutParts(const IterationReport& report,
                                  Estimate* start) {
  if (!HasTinyParts(problem_, *start)) return false;
  std::vector<Multiplier> multipliers;
  return FindEstimateBelow(problem_, (1 + kFreshStartMargin) * cost_,
                           OptionsForStart(report), context_, start,
                           &multipliers) == InteriorPointTermination::kFeasible;
}

// Looks for an estimate below `bound`, pixels, far from the boundary of the
// cones. If one is found, it becomes the best one. Otherwise tries to prove
// that there is none.
bool CertifiedSolve::TryBelow(double bound, const IterationReport& report) {
  const FeasibleStartOptions options = OptionsForStart(report);
  std::vector<Multiplier> multipliers;
  if (FindEstimateBelow(problem_, bound, options, context_, &estimate_,
                        &multipliers) == InteriorPointTermination::kFeasible) {
    LowerByFeasibility(problem_, options, context_, &estimate_);
    cost_ = Cost(problem_, estimate_, options_.norm, context_.num_threads);
    return true;
  }
  // A proof lowers the bound by a thousandth at most.
  const double sufficient =
      std::min((1 - 1e-3) * bound, (1 - options_.relative_gap) * cost_);
  Adopt(MakeInfeasibilityCertificate(problem_, options_.norm, bound,
                                     multipliers, Sufficient(sufficient),
                                     context_));
  return false;
}

// Bisects between the cost and the largest bound at which no estimate was
// found, until they are within `width`, relative. Returns whether there is a
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

// Returns whether there is a new estimate. First tries to find one just below
// the cost, or to prove that there is none. Bisects if neither succeeds, or if
// the last estimate found in this way did not lead to a clearly lower cost. The
// next bisection goes to a quarter of the width.
bool CertifiedSolve::FindFreshStart(const IterationReport& report) {
  const bool has_led_lower = cost_ < (1 - width_) * fresh_cost_;
  if (has_led_lower &&
      TryBelow((1 - options_.relative_gap / 2) * cost_, report)) {
    fresh_cost_ = cost_;
    return true;
  }
  if (IsGapReached()) return false;
  const bool is_fresh = Bisect(width_, report);
  width_ /= 4;
  fresh_cost_ = std::numeric_limits<double>::infinity();
  return is_fresh;
}

SolveTermination CertifiedSolve::Run(int max_iterations,
                                     const TakeEstimate& take,
                                     const IterationReport& report) {
  max_iterations_ = max_iterations;
  width_ = 1e-2;
  fresh_cost_ = std::numeric_limits<double>::infinity();
  if (options_.IsLowEnough(cost_)) return SolveTermination::kGapReached;
  double start_margin = are_multipliers_known_ ? WarmMargin() : kStartMargin;
  Estimate start = estimate_;
  if (EvenOutParts(report, &start)) start_margin = kFreshStartMargin;
  for (;;) {
    const InteriorPointTermination termination =
        RunFrom(start, start_margin, take, report);
    if (IsGapReached()) return SolveTermination::kGapReached;
    if (is_given_up_) return SolveTermination::kStalled;
    if (termination == InteriorPointTermination::kInterrupted) {
      return SolveTermination::kInterrupted;
    }
    if (iterations_ >= max_iterations_) {
      return SolveTermination::kMaxIterations;
    }
    if (std::exchange(are_multipliers_known_, false) && gap_ > kLargeGap) {
      start_margin = kStartMargin;  // once more, without a warm start
      continue;
    }
    start_margin = kFreshStartMargin;
    const bool is_fresh = FindFreshStart(report);
    if (IsGapReached()) return SolveTermination::kGapReached;
    if (context_.IsCancelled()) return SolveTermination::kInterrupted;
    if (iterations_ >= max_iterations_) {
      return SolveTermination::kMaxIterations;
    }
    if (!is_fresh) return SolveTermination::kStalled;
    start = estimate_;
  }
}

}  // namespace krot::internal
