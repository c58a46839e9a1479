#include "krot/joint/joint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/timer.h"
#include "krot/joint/certified_solve.h"
#include "krot/joint/extend_solution.h"
#include "krot/joint/working_set.h"
#include "krot/problem/components.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot {
namespace {

// A working set takes in the points that do not fit in below this share of its
// optimum, the worst first, and grows by this factor at most.
constexpr double kShareOfLevel = 0.8;
constexpr double kMaxGrowth = 3;
// Of the gap asked for, the share that a working set's own proof may leave; the
// rest is what other points may exceed its cost by.
constexpr double kShareOfGapForProof = 0.5;
// After so many rounds it takes in everything.
constexpr int kMaxRounds = 12;
// A component of fewer points for each frame is solved as it is: ties alone
// take in most of it.
constexpr int kFewPointsPerFrame = 10;

void CheckOptions(const JointOptions& options) {
  CheckArgument(options.norm.p == 2 || options.norm.IsPolyhedral(), "norm.p",
                options.norm.p, "1, 2 or infinity");
  CheckArgument(options.relative_gap > 0, "relative_gap", options.relative_gap,
                "> 0");
  CheckArgument(options.sufficient_cost >= 0, "sufficient_cost",
                options.sufficient_cost, ">= 0");
  CheckArgument(options.max_iterations >= 1, "max_iterations",
                options.max_iterations, ">= 1");
}

// A connected component on its way to its certified optimum, by way of the
// optima of growing working sets.
class ComponentSolve {
 public:
  ComponentSolve(const KnownRotationProblem& problem,
                 const JointOptions& options, const Context& context,
                 const Estimate& start)
      : problem_(problem),
        options_(options),
        context_(context),
        estimate_(start),
        cost_(CostOf(start)),
        set_(FirstWorkingSet(problem, start, options.norm, cost_)) {}

  // `report` is called after every iteration, with gap and target filled in.
  JointTermination Run(const IterationReport& report);

  const Estimate& estimate() const { return estimate_; }
  double cost() const { return std::min(cost_, reached_); }
  double lower_bound() const { return lower_bound_; }
  const std::optional<Certificate>& certificate() const { return certificate_; }
  int64_t num_working_observations() const { return num_working_observations_; }

 private:
  double CostOf(const Estimate& estimate) const {
    return Cost(problem_, estimate, options_.norm, context_.num_threads);
  }
  bool IsGapReached() const {
    return cost_ - lower_bound_ <= options_.relative_gap * cost_ ||
           IsLowEnough();
  }
  bool IsLowEnough() const {
    return cost_ <= options_.sufficient_cost || IsZeroUpToRounding(cost_);
  }
  JointTermination SolveWorkingSet(const IterationReport& report,
                                   Estimate* candidate);
  JointTermination SolvePart(const ProblemSubset& part,
                             const IterationReport& report,
                             Estimate* candidate);
  bool FitOthers(Estimate* candidate);
  void Keep(const Estimate& candidate);

  const KnownRotationProblem& problem_;
  const JointOptions options_;
  const Context context_;
  Estimate estimate_;  // the best so far
  double cost_ = 0;
  WorkingSet set_;
  // By a solve of all points that is under way.
  double reached_ = std::numeric_limits<double>::infinity();
  double level_ = 0;  // the cost of the working set's solution, pixels
  bool do_others_fit_ = false;  // when that was last tried
  double lower_bound_ = 0;
  std::optional<Certificate> certificate_;
  int iterations_ = 0;
  int64_t num_working_observations_ = 0;
};

// A working set whose solution leaves other points above it is not worth a
// proof, but more points.
JointTermination ComponentSolve::SolvePart(const ProblemSubset& part,
                                           const IterationReport& report,
                                           Estimate* candidate) {
  JointOptions options = options_;
  if (!set_.IsAll()) options.relative_gap *= kShareOfGapForProof;
  const Estimate start = part.Restrict(estimate_);
  CertifiedSolve solve(part.problem(), options, context_, start, lower_bound_);
  // What is below another part's bound already is good enough.
  if (solve.cost() <= lower_bound_) return JointTermination::kGapReached;
  if (iterations_ >= options_.max_iterations) {
    return JointTermination::kMaxIterations;
  }
  const auto replace = [&](Estimate optimum) {
    RestoreGaugeIfHarmless(part.problem(), start, options_.norm, context_,
                           &optimum);
    part.Replace(optimum, candidate);
  };
  const JointTermination termination = solve.Run(
      options_.max_iterations - iterations_,
      [&](const Estimate& estimate) {
        replace(estimate);
        do_others_fit_ = FitOthers(candidate);
        return do_others_fit_;
      },
      [&](const JointIteration& iteration) {
        if (set_.IsAll()) reached_ = std::min(reached_, solve.cost());
        report(iteration);
      });
  iterations_ += solve.iterations();
  if (solve.lower_bound() > lower_bound_) {
    lower_bound_ = solve.lower_bound();
    certificate_ = InWhole(part, *solve.certificate());
  }
  if (do_others_fit_) replace(solve.estimate());
  return termination;
}

JointTermination ComponentSolve::SolveWorkingSet(const IterationReport& report,
                                                 Estimate* candidate) {
  std::vector<int64_t> observations = set_.Observations();
  num_working_observations_ = static_cast<int64_t>(observations.size());
  do_others_fit_ = true;
  JointTermination worst = JointTermination::kGapReached;
  for (std::vector<int64_t>& part :
       SplitIntoComponents(problem_, std::move(observations))) {
    const JointTermination termination =
        SolvePart(ProblemSubset(problem_, std::move(part)), report, candidate);
    if (termination == JointTermination::kGapReached) continue;
    worst = termination;
    if (termination != JointTermination::kStalled || !do_others_fit_) break;
  }
  return worst;
}

// Whether the working set's solution extends to all points, none exceeding its
// cost by more than the gap leaves room for.
bool ComponentSolve::FitOthers(Estimate* candidate) {
  level_ = set_.Cost(*candidate, options_.norm);
  const double highest =
      level_ / (1 - (1 - kShareOfGapForProof) * options_.relative_gap);
  const bool do_fit = ExtendSolution(problem_, set_, options_.norm, context_,
                                     level_, highest, candidate);
  Keep(*candidate);
  return do_fit;
}

void ComponentSolve::Keep(const Estimate& candidate) {
  const double cost = CostOf(candidate);
  if (cost > cost_) return;
  cost_ = cost;
  estimate_ = candidate;
}

JointTermination ComponentSolve::Run(const IterationReport& report) {
  if (IsLowEnough()) return JointTermination::kGapReached;
  if (problem_.num_points < kFewPointsPerFrame * problem_.num_frames) {
    set_.AddAll();
  }
  for (int round = 1;; ++round) {
    Estimate candidate = estimate_;
    const JointTermination termination = SolveWorkingSet(report, &candidate);
    if (do_others_fit_) do_others_fit_ = FitOthers(&candidate);
    if (IsGapReached()) return JointTermination::kGapReached;
    if (set_.IsAll() || termination == JointTermination::kInterrupted ||
        termination == JointTermination::kMaxIterations) {
      return termination;
    }
    const int64_t num_added = set_.AddAbove(
        candidate, options_.norm, kShareOfLevel * level_,
        static_cast<int64_t>((kMaxGrowth - 1) * set_.num_points()) + 1);
    if (do_others_fit_ || num_added == 0 || round == kMaxRounds) set_.AddAll();
  }
}

}  // namespace

JointSummary SolveJoint(const KnownRotationProblem& problem,
                        const JointOptions& options, const Context& context,
                        Estimate* estimate) {
  CheckOptions(options);
  const Timer timer;
  JointSummary summary;
  summary.cost_initial =
      Cost(problem, *estimate, options.norm, context.num_threads);
  CheckArgument(std::isfinite(summary.cost_initial), "cost of the start",
                summary.cost_initial, "finite: all depths positive");

  std::vector<std::vector<int64_t>> components = SplitIntoComponents(problem);
  summary.num_components = static_cast<int32_t>(components.size());
  summary.termination = JointTermination::kGapReached;
  double cost_of_solved = 0;
  for (std::vector<int64_t>& observations : components) {
    const ProblemSubset part(problem, std::move(observations));
    ComponentSolve solve(part.problem(), options, context,
                         part.Restrict(*estimate));
    const JointTermination termination =
        solve.Run([&](JointIteration iteration) {
          iteration.cost = std::max(cost_of_solved, solve.cost());
          const double bound =
              std::max(summary.lower_bound, solve.lower_bound());
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
  summary.cost_final =
      Cost(problem, *estimate, options.norm, context.num_threads);
  // A component that fell short matters only if it sets the maximum.
  if (summary.termination != JointTermination::kInterrupted &&
      summary.RelativeGap() <= options.relative_gap) {
    summary.termination = JointTermination::kGapReached;
  }
  return summary;
}

}  // namespace krot
