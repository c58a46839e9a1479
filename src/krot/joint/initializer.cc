#include "krot/joint/joint.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

// A depth that is small against the scene, relative to the longest baseline or
// distance of fixed positions. Without either the scale is free, and any depth
// will do.
constexpr double kUnitDepthPerBaseline = 1e-2;
// LowerByFeasibility looks for estimates at this share of the cost.
constexpr double kShare = 0.25;

double UnitDepth(const KnownRotationProblem& problem) {
  double longest = FixedExtent(problem);
  for (const View& view : problem.views) {
    longest = std::max(longest, view.cam_from_rig_translation.norm());
  }
  return longest > 0 ? kUnitDepthPerBaseline * longest : 1;
}

}  // namespace

InteriorPointTermination FindEstimateBelow(
    const KnownRotationProblem& problem, double bound,
    const FeasibleStartOptions& options, const Context& context,
    Estimate* estimate, std::vector<Multiplier>* multipliers) {
  InteriorPointOptions conic;
  conic.norm = options.norm;
  conic.max_iterations = options.max_iterations;
  conic.stop = [&](const ConicIterate& iterate) {
    if (options.callback) options.callback(bound);
    return iterate.gamma > 1 && iterate.gap < options.hopeless_gap;
  };
  return FindFeasible(problem, conic, context, bound,
                      options.unit_depth.value_or(UnitDepth(problem)), estimate,
                      multipliers)
      .termination;
}

bool LowerByFeasibility(const KnownRotationProblem& problem,
                        const FeasibleStartOptions& options,
                        const Context& context, Estimate* estimate) {
  bool is_lower = false;
  std::vector<Multiplier> multipliers;
  for (;;) {
    const double cost =
        Cost(problem, *estimate, options.norm, context.num_threads);
    if (!(kShare * cost > options.known_bound) ||
        FindEstimateBelow(problem, kShare * cost, options, context, estimate,
                          &multipliers) !=
            InteriorPointTermination::kFeasible) {
      return is_lower;
    }
    is_lower = true;
  }
}

namespace {

// Where no estimate is found at a bound, one is sought at this many times the
// bound, again and again up to the largest.
constexpr double kBoundGrowth = 10;
constexpr double kLargestBound = 1e7;  // pixels
// To prove that a bound cannot be met, the proved bound must exceed it by this,
// relative, which is well above rounding.
constexpr double kClearlyAbove = 1e-9;
// FeasibleStartOptions::hopeless_gap for lowering a start that already meets
// the bound.
constexpr double kHopelessStartGap = 1e-2;

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
  InitializerTermination Run(Estimate* start);

 private:
  FeasibleStartOptions StartOptions(double hopeless_gap);
  InitializerTermination DecideByOptimum(Estimate* estimate);
  bool Proves(Certificate certificate);
  void Record(JointIteration iteration);

  const ProblemSubset& part_;
  const InitializerOptions options_;
  const Context context_;
  const Timer& timer_;
  InitializerSummary& summary_;
};

void StartSearch::Record(JointIteration iteration) {
  iteration.seconds = timer_.Seconds();
  summary_.iterations.push_back(iteration);
  if (!options_.callback) return;
  options_.callback(static_cast<int>(summary_.iterations.size()), iteration);
}

FeasibleStartOptions StartSearch::StartOptions(double hopeless_gap) {
  FeasibleStartOptions start;
  start.norm = options_.norm;
  start.max_iterations = options_.max_iterations;
  start.hopeless_gap = hopeless_gap;
  start.callback = [this](double bound) {
    JointIteration iteration;
    iteration.target = bound;
    Record(iteration);
  };
  return start;
}

// Called where no estimate was found at the bound, nor a proof that there is
// none. Finds an estimate at a larger bound and solves from there for the
// optimum: it meets the bound itself, or its certificate proves that there is
// no start.
InitializerTermination StartSearch::DecideByOptimum(Estimate* estimate) {
  std::vector<Multiplier> multipliers;
  for (double bound = kBoundGrowth * options_.max_error; bound <= kLargestBound;
       bound *= kBoundGrowth) {
    const InteriorPointTermination found =
        FindEstimateBelow(part_.problem(), bound, StartOptions(0), context_,
                          estimate, &multipliers);
    if (found == InteriorPointTermination::kInterrupted) {
      return InitializerTermination::kInterrupted;
    }
    if (found != InteriorPointTermination::kFeasible) continue;
    JointOptions joint;
    joint.norm = options_.norm;
    joint.max_iterations = options_.max_iterations;
    joint.callback = [this](int, const JointIteration& iteration) {
      Record(iteration);
    };
    const JointSummary optimum =
        SolveJoint(part_.problem(), joint, context_, estimate);
    if (optimum.certificate && Proves(*optimum.certificate)) {
      return InitializerTermination::kInfeasible;
    }
    if (optimum.termination == JointTermination::kInterrupted) {
      return InitializerTermination::kInterrupted;
    }
    return optimum.cost_final < options_.max_error
               ? InitializerTermination::kFeasible
               : InitializerTermination::kFailed;
  }
  return InitializerTermination::kFailed;
}

// Whether a certificate of the part proves that there is no start. If so, keeps
// it in the summary.
bool StartSearch::Proves(Certificate certificate) {
  const CertificateCheck check =
      CheckCertificate(part_.problem(), options_.norm, certificate);
  if (!(check.proved_bound > options_.max_error)) return false;
  summary_.lower_bound = check.proved_bound;
  summary_.certificate = InWhole(part_, std::move(certificate));
  return true;
}

InitializerTermination StartSearch::Run(Estimate* start) {
  std::vector<Multiplier> multipliers;
  const InteriorPointTermination found =
      FindEstimateBelow(part_.problem(), options_.max_error, StartOptions(0),
                        context_, start, &multipliers);
  if (found == InteriorPointTermination::kInterrupted) {
    return InitializerTermination::kInterrupted;
  }
  if (found != InteriorPointTermination::kFeasible) {
    CertificateOptions enough;
    enough.sufficient_bound = (1 + kClearlyAbove) * options_.max_error;
    const std::optional<Certificate> certificate = MakeInfeasibilityCertificate(
        part_.problem(), options_.norm, options_.max_error, multipliers, enough,
        context_);
    if (certificate && Proves(*certificate)) {
      return InitializerTermination::kInfeasible;
    }
    const InitializerTermination decision = DecideByOptimum(start);
    if (decision != InitializerTermination::kFeasible) return decision;
  }
  LowerByFeasibility(part_.problem(), StartOptions(kHopelessStartGap), context_,
                     start);
  return context_.IsCancelled() ? InitializerTermination::kInterrupted
                                : InitializerTermination::kFeasible;
}

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
    if (summary.termination != InitializerTermination::kFeasible) {
      return summary;
    }
    if (!HasBaseline(part.problem()) && !HasFixed(part.problem())) {
      NormalizeScale(part.problem(), &start);
    }
    part.Replace(start, &found);
  }
  summary.termination = InitializerTermination::kFeasible;
  summary.cost = Cost(problem, found, options.norm, context.num_threads);
  *estimate = std::move(found);
  return summary;
}

}  // namespace krot::internal
