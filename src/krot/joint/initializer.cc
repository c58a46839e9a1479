#include "krot/joint/initializer.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/timer.h"
#include "krot/joint/feasible_start.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/restrict.h"

namespace krot {
namespace {

// To prove a bound infeasible, an estimate is sought at this many times the
// bound, and again, and its cost lowered to the optimum.
constexpr double kBoundGrowth = 10;
constexpr double kLargestBound = 1e7;  // pixels
// When lowering a start that already meets the bound is given up.
constexpr double kHopelessStartGap = 1e-2;

// Scales the estimate to a median depth of one.
void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate) {
  const double median = MedianDepth(problem, *estimate);
  for (Eigen::Vector3d& t : estimate->translations) t /= median;
  for (Eigen::Vector3d& s : estimate->points) s /= median;
}

// A component's way to a start.
class StartSearch {
 public:
  // Keeps references. Adds iterations to `summary`, and what was proved.
  StartSearch(const RestrictedProblem& part, const InitializerOptions& options,
              const Timer& timer, InitializerSummary* summary)
      : part_(part), options_(options), timer_(timer), summary_(*summary) {}

  // `*start` is meaningful if feasible.
  InitializerTermination Run(Estimate* start);

 private:
  FeasibleStartOptions StartOptions(double hopeless_gap);
  InitializerTermination DecideByOptimum(Estimate* estimate);
  bool Proves(Certificate certificate);
  void Record(JointIteration iteration);

  const RestrictedProblem& part_;
  const InitializerOptions& options_;
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
  start.num_threads = options_.num_threads;
  start.cancel = options_.cancel;
  start.callback = [this](double bound) {
    JointIteration iteration;
    iteration.target = bound;
    Record(iteration);
  };
  return start;
}

// Where no estimate was found at the bound, the optimum decides: sought from an
// estimate that misses the bound, it proves that there is none, or meets the
// bound itself.
InitializerTermination StartSearch::DecideByOptimum(Estimate* estimate) {
  std::vector<Multiplier> multipliers;
  for (double bound = kBoundGrowth * options_.max_error; bound <= kLargestBound;
       bound *= kBoundGrowth) {
    const InteriorPointTermination found = FindEstimateBelow(
        part_.problem, bound, StartOptions(0), estimate, &multipliers);
    if (found == InteriorPointTermination::kInterrupted) {
      return InitializerTermination::kInterrupted;
    }
    if (found != InteriorPointTermination::kFeasible) continue;
    JointOptions joint;
    joint.norm = options_.norm;
    joint.max_iterations = options_.max_iterations;
    joint.num_threads = options_.num_threads;
    joint.cancel = options_.cancel;
    joint.callback = [this](int, const JointIteration& iteration) {
      Record(iteration);
    };
    const JointSummary optimum = SolveJoint(part_.problem, joint, estimate);
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

// Whether a certificate of the part shows that there is no start. Keeps it
// then.
bool StartSearch::Proves(Certificate certificate) {
  const CertificateCheck check =
      CheckCertificate(part_.problem, options_.norm, certificate);
  if (!(check.proved_bound > options_.max_error)) return false;
  for (CertifiedObservation& o : certificate.observations) {
    o.observation = part_.observation_of[o.observation];
  }
  summary_.lower_bound = check.proved_bound;
  summary_.certificate = std::move(certificate);
  return true;
}

InitializerTermination StartSearch::Run(Estimate* start) {
  std::vector<Multiplier> multipliers;
  const InteriorPointTermination found = FindEstimateBelow(
      part_.problem, options_.max_error, StartOptions(0), start, &multipliers);
  if (found == InteriorPointTermination::kInterrupted) {
    return InitializerTermination::kInterrupted;
  }
  if (found != InteriorPointTermination::kFeasible) {
    CertificateOptions proof;
    proof.cancel = options_.cancel;
    const std::optional<Certificate> certificate = MakeInfeasibilityCertificate(
        part_.problem, options_.norm, options_.max_error, multipliers, proof);
    if (certificate && Proves(*certificate)) {
      return InitializerTermination::kInfeasible;
    }
    const InitializerTermination decision = DecideByOptimum(start);
    if (decision != InitializerTermination::kFeasible) return decision;
  }
  LowerByFeasibility(part_.problem, StartOptions(kHopelessStartGap), start);
  return IsCancelled(options_.cancel) ? InitializerTermination::kInterrupted
                                      : InitializerTermination::kFeasible;
}

}  // namespace

InitializerSummary FindStart(const KnownRotationProblem& problem,
                             const InitializerOptions& options,
                             Estimate* estimate) {
  CheckArgument(options.max_error > 0, "max_error", options.max_error, "> 0");
  const Timer timer;
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
    summary.termination =
        StartSearch(part, options, timer, &summary).Run(&start);
    if (summary.termination != InitializerTermination::kFeasible) {
      return summary;
    }
    if (!HasBaseline(part.problem)) NormalizeScale(part.problem, &start);
    ReplaceEstimate(part, start, &found);
  }
  summary.termination = InitializerTermination::kFeasible;
  summary.cost = Cost(problem, found, options.norm, options.num_threads);
  *estimate = std::move(found);
  return summary;
}

}  // namespace krot
