#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/geometry.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// Scores that are large for observations that set the maximum gamma:
//
//   (lambda_i w_i / sum_j lambda_j w_j) / (1 - r_i / gamma).
//
// Multipliers alone span many decades among observations that matter; on the
// central path the product of numerator and denominator is the same for all,
// so the quotient separates them.
std::vector<double> SupportScores(const KnownRotationProblem& problem,
                                  Norm norm, const Estimate& estimate,
                                  double gamma,
                                  const std::vector<Multiplier>& multipliers);

// The observations whose score exceeds `threshold`, without those that
// contribute nothing to a bound (PruneUnconstrained). Ascending.
std::vector<int64_t> SelectSupport(const KnownRotationProblem& problem,
                                   const std::vector<double>& scores,
                                   double threshold);

// The observations whose lambda exceeds `share` of the largest.
std::vector<int64_t> SelectLarge(const std::vector<Multiplier>& multipliers,
                                 double share);

// Drops points, those with the smallest sums of lambda first, as long as no
// frame that is not fixed loses more than `share` of its own sum of lambda.
// Returns all observations of the points that are left. If (1) of
// certificate_check.h nearly holds for all observations, it still nearly does.
std::vector<int64_t> SelectForFrames(const KnownRotationProblem& problem,
                                     const std::vector<Multiplier>& multipliers,
                                     double share);

// The largest subset of the `candidates`, ascending, for which the dual
// residual at every point and frame that is not fixed (the sum of gradients,
// force_checker.h, at `delta` pixels) is below `tolerance` > 0 times the
// largest delta lambda there. Observations at other points and frames, and
// those that contribute nothing to a bound, are dropped until none is left.
std::vector<int64_t> SelectBalanced(const KnownRotationProblem& problem,
                                    double delta,
                                    const std::vector<Multiplier>& multipliers,
                                    std::vector<int64_t> candidates,
                                    double tolerance);

// The bound that multipliers would prove, pixels, if (1) of certificate_check.h
// held. It follows from multiplying (1) by the estimate.
double SuggestedBound(const KnownRotationProblem& problem,
                      const Estimate& estimate,
                      const std::vector<Multiplier>& multipliers);

struct CertificateOptions {
  // The search ends with the first certificate that proves this bound, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
  // Supports with more unknowns are not tried; >= 1.
  int max_unknowns = 15000;
};

// A lower bound on every estimate's cost with its proof, made from an interior
// point's iterate: positive depths, residuals below gamma, one multiplier per
// observation. The multipliers need not prove anything by themselves; they show
// which observations may set the maximum.
//
// For several thresholds of SupportScores it takes the observations above, and
// each of their connected components by itself, as each gives a bound. It
// repairs their multipliers; then only those that are nearly stationary
// (SelectBalanced); then those of a solve of the sub-problem, which is reduced
// to what sets its maximum. It keeps the highest bound that CheckCertificate
// accepts; none if there is none. p = 1, 2 or infinity. Allocates as much as a
// few sub-problems.
std::optional<Certificate> MakeCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    double gamma, const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// The same from the multipliers with which FindFeasible ends if no estimate has
// all its residuals below `bound`, pixels. The certificate's bound is near
// `bound`; it is made of multipliers that are nearly stationary
// (SelectBalanced), for several tolerances.
std::optional<Certificate> MakeInfeasibilityCertificate(
    const KnownRotationProblem& problem, Norm norm, double bound,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// A certificate of a part, with the observation indices of the whole problem.
Certificate InWhole(const ProblemSubset& part, Certificate certificate);

// The highest bound that repaired multipliers of all observations prove,
// without points that frames can spare (SelectForFrames): for rows that have
// changed a little since their multipliers were found. None if there is none.
std::optional<Certificate> RepairCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

}  // namespace krot::internal
