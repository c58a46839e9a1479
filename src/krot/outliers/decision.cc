#include "krot/outliers/decision.h"

#include <utility>

#include "krot/bridge/reprojection.h"
#include "krot/joint/initializer.h"
#include "krot/joint/joint.h"
#include "krot/pipeline/pixel_proof.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// Of the rows, round by round, as long as nothing is decided: optima as near
// to the bound as the last stay undecided.
constexpr double kDecisionGaps[] = {1e-2, 1e-3, 1e-5, 1e-6};
// What a start from nothing has to be below, in bounds.
constexpr double kRoughStart = 1000;
// Of a decision in all. Most take three, and where they are hardest (an
// endoscope's lens, wrong rotations) one of a thousand takes 200.
constexpr int kMaxIterations = 400;
// What true errors may be above those of the rows.
constexpr double kRoomForLenses = 1e-6;
// Of the rows of a refutation that is to be proved.
constexpr double kProofGap = 1e-6;
constexpr double kJustAbove = 1e-9;
// Rows whose bound is nearer to it have no room to be widened.
constexpr double kWorthWidening = 1e-2;

void Add(const KnownRotationProblem& problem,
         const std::vector<JointIteration>& iterations, Work* work) {
  work->done +=
      static_cast<int64_t>(iterations.size() * problem.observations.size());
}

// Whether all depths of `*start` are positive, or of one that is found instead.
bool HaveStart(const KnownRotationProblem& problem, const ErrorBound& bound,
               const Context& context, Estimate* start, Work* work) {
  if (AllDepthsPositive(problem, *start, context.num_threads)) return true;
  InitializerOptions options;
  options.norm = bound.norm;
  options.max_error = kRoughStart * bound.max_error;
  const InitializerSummary summary =
      FindStart(problem, options, context, start);
  Add(problem, summary.iterations, work);
  return summary.termination == InitializerTermination::kFeasible;
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
  for (const double gap : kDecisionGaps) {
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

std::optional<PixelCertificate> ProveRefutation(
    const Model& model, const BuiltProblem& part, const ErrorBound& bound,
    const Decision& refuted, const Context& context, Work* work) {
  BuiltProblem at_estimate = part;
  Reprojection(model, part)
      .TakeRows(refuted.estimate, context.num_threads, &at_estimate.problem);
  const auto is_accepted = [&](const PixelCertificate& proof) {
    return proof.lower_bound > bound.max_error &&
           CheckPixelCertificate(model, part, bound.norm, proof, context)
               .is_accepted;
  };
  // No more than the bound need be proved: what the rows' bound is above it by
  // is room for the lenses.
  JointOptions options;
  options.norm = bound.norm;
  options.relative_gap = kProofGap;
  options.max_iterations = kMaxIterations;
  Estimate estimate = refuted.estimate;
  const JointSummary summary =
      SolveJoint(at_estimate.problem, options, context, &estimate);
  Add(at_estimate.problem, summary.iterations, work);
  if (!summary.certificate) return std::nullopt;
  PixelCertificate proof;
  proof.rows = *summary.certificate;
  proof.bearings = BearingsOfPoints(model, part, refuted.estimate, proof.rows);
  proof.lower_bound = (1 + kJustAbove) * bound.max_error;
  if (is_accepted(proof)) return proof;
  if (summary.lower_bound < (1 + kWorthWidening) * bound.max_error) {
    return std::nullopt;
  }
  std::optional<PixelCertificate> best =
      ProveInPixels(model, at_estimate, refuted.estimate, bound.norm,
                    refuted.support, proof.lower_bound, context);
  if (!best || !is_accepted(*best)) return std::nullopt;
  return best;
}

}  // namespace krot::internal
