#include "krot/outliers/removal.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"

namespace krot::internal {
namespace {

// Joint iterations of one decision. Most take three, and where they are hardest
// (an endoscope's lens, wrong rotations) one of a thousand takes 200.
constexpr int kMaxIterations = 400;
// Relative margin for the difference between the rows' errors and true ones.
constexpr double kRoomForLenses = 1e-6;

void Add(const KnownRotationProblem& problem,
         const std::vector<JointIteration>& iterations, Work* work) {
  work->done +=
      static_cast<int64_t>(iterations.size() * problem.observations.size());
}

// Whether all depths of `*start` are positive; where not, looks for another
// one.
bool HaveStart(const KnownRotationProblem& problem, const ErrorBound& bound,
               const Context& context, Estimate* start, Work* work) {
  if (AllDepthsPositive(problem, *start, context.num_threads)) return true;
  InitializerOptions options;
  options.norm = bound.norm;
  options.max_error = 1000 * bound.max_error;
  const InitializerSummary summary =
      FindStart(problem, options, context, start);
  Add(problem, summary.iterations, work);
  return summary.termination == SolveTermination::kWithinBound;
}

}  // namespace

Decision Decide(const Model& model, const BuiltProblem& given,
                const ErrorBound& bound, const Context& context, Work* work) {
  Decision decision;
  decision.estimate = given.start;
  BuiltProblem part = given;
  const Reprojection reprojection(model, part);
  JointOptions options;
  options.norm = bound.norm;
  options.sufficient_cost = (1 - kRoomForLenses) * bound.max_error;
  options.max_iterations = kMaxIterations;
  if (!HaveStart(part.problem, bound, context, &decision.estimate, work)) {
    return decision;
  }
  // An optimum nearer to the bound than the last gap stays undecided.
  for (const double gap : {1e-2, 1e-3, 1e-5, 1e-6}) {
    options.relative_gap = gap;
    reprojection.TakeRows(decision.estimate, context.num_threads,
                          &part.problem);
    if (!AllDepthsPositive(part.problem, decision.estimate,
                           context.num_threads)) {
      break;
    }
    const JointSummary summary =
        SolveJoint(part.problem, options, context, &decision.estimate);
    Add(part.problem, summary.iterations, work);
    if (context.IsCancelled()) break;
    if (reprojection.TrueCost(decision.estimate, bound.norm,
                              context.num_threads) <= bound.max_error) {
      decision.is_feasible = true;
      break;
    }
    if (summary.certificate &&
        summary.lower_bound > (1 + kRoomForLenses) * bound.max_error) {
      decision.is_refuted = true;
      for (const CertifiedObservation& o : summary.certificate->observations) {
        decision.support.push_back(o.observation);
      }
      break;
    }
    options.max_iterations -= static_cast<int>(summary.iterations.size());
    if (options.max_iterations < 1) break;
  }
  return decision;
}

namespace {

// Proves in true pixels what Decide refuted; the proof is checked. None if lens
// distortion takes up too much of the margin. Adds to `*work`.
std::optional<PixelCertificate> ProveRefutation(
    const Model& model, const BuiltProblem& part, const ErrorBound& bound,
    const Decision& refuted, const Context& context, Work* work) {
  BuiltProblem at_estimate = part;
  Reprojection(model, part)
      .TakeRows(refuted.estimate, context.num_threads, &at_estimate.problem);
  // Only the bound needs a proof: the margin of the rows' bound above it is
  // room for lens distortion.
  JointOptions options;
  options.norm = bound.norm;
  options.relative_gap = 1e-6;
  options.max_iterations = kMaxIterations;
  Estimate estimate = refuted.estimate;
  const JointSummary summary =
      SolveJoint(at_estimate.problem, options, context, &estimate);
  Add(at_estimate.problem, summary.iterations, work);
  if (!summary.certificate) return std::nullopt;
  PixelCertificate proof;
  proof.rows = *summary.certificate;
  proof.bearings = BearingsOfPoints(model, part, refuted.estimate, proof.rows);
  proof.lower_bound = (1 + 1e-9) * bound.max_error;
  const bool is_accepted =
      CheckPixelCertificate(model, part, bound.norm, proof, context)
          .is_accepted;
  return is_accepted ? std::optional(std::move(proof)) : std::nullopt;
}

std::vector<int64_t> Without(const std::vector<int64_t>& from,
                             const std::vector<int64_t>& what) {
  std::vector<int64_t> rest;
  std::set_difference(from.begin(), from.end(), what.begin(), what.end(),
                      std::back_inserter(rest));
  return rest;
}

std::vector<std::vector<int64_t>> Parts(
    const BuiltProblem& built, const std::vector<int64_t>& observations) {
  return SplitIntoComponents(built.problem,
                             PruneUnconstrained(built.problem, observations));
}

// Makes a refuted support irreducible: leaves in `*kept`, which are at first
// all observations of its own small problem, those that are necessary. False if
// the support is too large, or if an observation is kept only because nothing
// was decided.
bool MakeIrreducible(const Model& model, const BuiltProblem& support,
                     const ErrorBound& bound, const Context& context,
                     Work* work, std::vector<int64_t>* kept) {
  if (kept->size() > 60) return false;  // a solve per observation
  bool is_irreducible = true;
  std::vector<int64_t> untried = *kept;
  while (!untried.empty() && !context.IsCancelled()) {
    const int64_t spared = untried.back();
    untried.pop_back();
    bool is_feasible = true;
    for (const std::vector<int64_t>& part :
         Parts(support, Without(*kept, {spared}))) {
      const ProblemSubset subset(support.problem, part);
      Decision decision =
          Decide(model, BuiltPart(support, subset, support.start), bound,
                 context, work);
      is_feasible = is_feasible && decision.is_feasible;
      if (!decision.is_refuted) continue;
      is_feasible = true;
      *kept = subset.InWhole(std::move(decision.support));
      std::vector<int64_t> left;
      std::set_intersection(untried.begin(), untried.end(), kept->begin(),
                            kept->end(), std::back_inserter(left));
      untried = std::move(left);
      break;
    }
    is_irreducible = is_irreducible && is_feasible;
  }
  return is_irreducible;
}

}  // namespace

std::optional<Conflict> FindConflict(const Model& model,
                                     const BuiltProblem& built,
                                     const ErrorBound& bound,
                                     const std::vector<int64_t>& observations,
                                     const Context& context, Work* work) {
  const ProblemSubset subset(built.problem, observations);
  const BuiltProblem part = BuiltPart(built, subset, built.start);
  const Decision first = Decide(model, part, bound, context, work);
  if (!first.is_refuted) return std::nullopt;

  const ProblemSubset support(part.problem, first.support);
  auto kept = NumbersUpTo<int64_t>(SignedSize(first.support));
  Conflict conflict;
  conflict.is_irreducible = MakeIrreducible(
      model, BuiltPart(part, support, part.start), bound, context, work, &kept);
  conflict.observations = subset.InWhole(support.InWhole(std::move(kept)));
  return conflict;
}

bool ProveConflict(const Model& model, const BuiltProblem& built,
                   const ErrorBound& bound, const Context& context,
                   Conflict* conflict, Work* work) {
  const ProblemSubset subset(built.problem, conflict->observations);
  const BuiltProblem part = BuiltPart(built, subset, built.start);
  const Decision decision = Decide(model, part, bound, context, work);
  if (!decision.is_refuted) return false;
  std::optional<PixelCertificate> proof =
      ProveRefutation(model, part, bound, decision, context, work);
  if (!proof) return false;
  conflict->proof = *std::move(proof);
  conflict->proof.rows = InWhole(subset, std::move(conflict->proof.rows));
  conflict->observations.clear();
  for (const CertifiedObservation& o : conflict->proof.rows.observations) {
    conflict->observations.push_back(o.observation);
  }
  return true;
}

// A built problem has its observations in the order of the model's tracks.
std::vector<uint64_t> ElementsOf(const Model& model,
                                 const BuiltProblem& built) {
  const std::vector<Role> roles = RolesOf(model, built, SameImage::kKeep);
  std::vector<uint64_t> elements;
  for (const int32_t k : built.point_of) {
    const Point3D& point = model.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (roles[e] == Role::kIn) elements.push_back(e);
    }
  }
  return elements;
}

}  // namespace krot::internal
