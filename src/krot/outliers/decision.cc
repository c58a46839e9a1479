#include "krot/outliers/decision.h"

#include <utility>

#include "krot/bridge/reprojection.h"
#include "krot/joint/joint.h"
#include "krot/pipeline/pixel_proof.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

// Of the rows, round by round, as long as nothing is decided: optima as near
// to the bound as the last stay undecided.
constexpr double kDecisionGaps[] = {1e-2, 1e-3, 1e-5, 1e-6};
// What true errors may be above those of the rows.
constexpr double kRoomForLenses = 1e-6;

}  // namespace

Decision Decide(const Model& model, const BuiltProblem& given,
                const ErrorBound& bound, const Context& context) {
  Decision decision;
  decision.estimate = given.start;
  BuiltProblem part = given;
  const Reprojection reprojection(model, part);
  JointOptions options;
  options.norm = bound.norm;
  options.sufficient_cost = (1 - kRoomForLenses) * bound.max_error;
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
  }
  return decision;
}

std::optional<PixelCertificate> ProveRefutation(const Model& model,
                                                const BuiltProblem& part,
                                                const ErrorBound& bound,
                                                const Decision& refuted,
                                                const Context& context) {
  BuiltProblem at_estimate = part;
  Reprojection(model, part)
      .TakeRows(refuted.estimate, context.num_threads, &at_estimate.problem);
  std::optional<PixelCertificate> proof =
      ProveInPixels(model, at_estimate, refuted.estimate, bound.norm,
                    refuted.support, context);
  if (!proof || !(proof->lower_bound > bound.max_error) ||
      !CheckPixelCertificate(model, part, bound.norm, *proof, context)
           .is_accepted) {
    return std::nullopt;
  }
  return proof;
}

}  // namespace krot
