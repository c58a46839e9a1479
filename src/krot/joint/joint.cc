#include "krot/joint/joint.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/conic/cones.h"
#include "krot/joint/component_solve.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
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
  summary.termination = SolveTermination::kGapReached;
  double cost_of_solved = 0;
  for (std::vector<int64_t>& observations : components) {
    const ProblemSubset part =
        context.ranks == nullptr
            ? ProblemSubset(problem, std::move(observations))
            : ProblemSubset(problem);
    KnownMultipliers own;
    ComponentSolve solve(
        part.problem(), options, context, part.Restrict(*estimate),
        known != nullptr && components.size() == 1 ? known : &own);
    const SolveTermination termination =
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
    if (termination != SolveTermination::kGapReached) {
      summary.termination = termination;
    }
    if (termination == SolveTermination::kInterrupted) break;
  }
  summary.cost_final = cost_of(*estimate);
  // A component that did not reach the gap matters only if it sets the maximum.
  if (summary.termination != SolveTermination::kInterrupted &&
      summary.RelativeGap() <= options.relative_gap) {
    summary.termination = SolveTermination::kGapReached;
  }
  return summary;
}

namespace {

constexpr int kMaxIterationsOfStart = 200;

// A depth that is small against the scene, as far as baselines or fixed
// positions tell. Without either the scale is free, and any depth will do.
double UnitDepth(const KnownRotationProblem& problem) {
  const double longest =
      std::max(FixedExtent(problem), LongestBaseline(problem));
  return longest > 0 ? 1e-2 * longest : 1;
}

}  // namespace

InteriorPointTermination FindEstimateBelow(
    const KnownRotationProblem& problem, double bound,
    const FeasibleStartOptions& options, const Context& context,
    Estimate* estimate, std::vector<Multiplier>* multipliers) {
  InteriorPointOptions conic;
  conic.norm = options.norm;
  conic.max_iterations = kMaxIterationsOfStart;
  conic.stop = [&](const ConicIterate& iterate) {
    if (options.callback) options.callback(bound);
    return iterate.gamma > 1 && iterate.gap < options.hopeless_gap;
  };
  return FindFeasible(problem, conic, context, bound,
                      options.unit_depth.value_or(UnitDepth(problem)), estimate,
                      multipliers)
      .termination;
}

void LowerByFeasibility(const KnownRotationProblem& problem,
                        const FeasibleStartOptions& options,
                        const Context& context, Estimate* estimate) {
  std::vector<Multiplier> multipliers;
  for (;;) {
    const double bound =
        Cost(problem, *estimate, options.norm, context.num_threads) / 4;
    if (!(bound > options.known_bound) ||
        FindEstimateBelow(problem, bound, options, context, estimate,
                          &multipliers) !=
            InteriorPointTermination::kFeasible) {
      return;
    }
  }
}

namespace {

// Searches a start of one component.
class StartSearch {
 public:
  // Keeps references to the part, the timer and the summary. Adds the
  // iterations and a certificate, if one is found, to `summary`.
  StartSearch(const ProblemSubset& part, const InitializerOptions& options,
              const Context& context, const Timer& timer,
              InitializerSummary* summary)
      : part_(part),
        options_(options),
        context_(context),
        timer_(timer),
        summary_(*summary) {}

  // `*start` is meaningful if feasible.
  SolveTermination Run(Estimate* start) {
    std::vector<Multiplier> multipliers;
    const InteriorPointTermination found =
        FindEstimateBelow(part_.problem(), options_.max_error, StartOptions(0),
                          context_, start, &multipliers);
    if (found == InteriorPointTermination::kInterrupted) {
      return SolveTermination::kInterrupted;
    }
    if (found != InteriorPointTermination::kFeasible) {
      CertificateOptions enough;
      enough.sufficient_bound = (1 + 1e-9) * options_.max_error;  // rounding
      const std::optional<Certificate> certificate =
          MakeInfeasibilityCertificate(part_.problem(), options_.norm,
                                       options_.max_error, multipliers, enough,
                                       context_);
      if (certificate && Proves(*certificate)) {
        return SolveTermination::kInfeasible;
      }
      const SolveTermination decision = DecideByOptimum(start);
      if (decision != SolveTermination::kWithinBound) return decision;
    }
    LowerByFeasibility(part_.problem(), StartOptions(/*hopeless_gap=*/1e-2),
                       context_, start);
    return context_.IsCancelled() ? SolveTermination::kInterrupted
                                  : SolveTermination::kWithinBound;
  }

 private:
  FeasibleStartOptions StartOptions(double hopeless_gap) {
    FeasibleStartOptions start;
    start.norm = options_.norm;
    start.hopeless_gap = hopeless_gap;
    start.callback = [this](double bound) {
      JointIteration iteration;
      iteration.target = bound;
      Record(iteration);
    };
    return start;
  }

  // Called where no estimate was found at the bound, nor a proof that there is
  // none. Finds an estimate at a larger bound, ten times each, and solves from
  // there for the optimum: it meets the bound itself, or its certificate proves
  // that there is no start.
  SolveTermination DecideByOptimum(Estimate* estimate) {
    std::vector<Multiplier> multipliers;
    for (double bound = 10 * options_.max_error; bound <= 1e7; bound *= 10) {
      const InteriorPointTermination found =
          FindEstimateBelow(part_.problem(), bound, StartOptions(0), context_,
                            estimate, &multipliers);
      if (found == InteriorPointTermination::kInterrupted) {
        return SolveTermination::kInterrupted;
      }
      if (found != InteriorPointTermination::kFeasible) continue;
      JointOptions joint;
      joint.norm = options_.norm;
      joint.max_iterations = kMaxIterationsOfStart;
      joint.callback = [this](int, const JointIteration& iteration) {
        Record(iteration);
      };
      const JointSummary optimum =
          SolveJoint(part_.problem(), joint, context_, estimate);
      if (optimum.certificate && Proves(*optimum.certificate)) {
        return SolveTermination::kInfeasible;
      }
      if (optimum.termination == SolveTermination::kInterrupted) {
        return SolveTermination::kInterrupted;
      }
      return optimum.cost_final < options_.max_error
                 ? SolveTermination::kWithinBound
                 : SolveTermination::kNoStart;
    }
    return SolveTermination::kNoStart;
  }

  // Whether a certificate of the part proves that there is no start. If so,
  // keeps it in the summary.
  bool Proves(Certificate certificate) {
    const CertificateCheck check =
        CheckCertificate(part_.problem(), options_.norm, certificate);
    if (!(check.proved_bound > options_.max_error)) return false;
    summary_.lower_bound = check.proved_bound;
    summary_.certificate = InWhole(part_, std::move(certificate));
    return true;
  }

  void Record(JointIteration iteration) {
    iteration.seconds = timer_.Seconds();
    summary_.iterations.push_back(iteration);
    if (!options_.callback) return;
    options_.callback(static_cast<int>(summary_.iterations.size()), iteration);
  }

  const ProblemSubset& part_;
  const InitializerOptions options_;
  const Context context_;
  const Timer& timer_;
  InitializerSummary& summary_;
};

}  // namespace

InitializerSummary FindStart(const KnownRotationProblem& problem,
                             const InitializerOptions& options,
                             const Context& context, Estimate* estimate) {
  CheckPositive(options.max_error, "max_error");
  const Timer timer;
  InitializerSummary summary;
  Estimate found = *estimate;
  found.translations.resize(problem.num_frames, Eigen::Vector3d::Zero());
  found.points.resize(problem.num_points, Eigen::Vector3d::Zero());
  for (std::vector<int64_t>& observations : SplitIntoComponents(problem)) {
    const ProblemSubset part(problem, std::move(observations));
    Estimate start;
    summary.termination =
        StartSearch(part, options, context, timer, &summary).Run(&start);
    if (summary.termination != SolveTermination::kWithinBound) {
      return summary;
    }
    if (!HasBaseline(part.problem()) && !HasFixed(part.problem())) {
      NormalizeScale(part.problem(), &start);
    }
    part.Replace(start, &found);
  }
  summary.termination = SolveTermination::kWithinBound;
  *estimate = std::move(found);
  return summary;
}

}  // namespace krot::internal
