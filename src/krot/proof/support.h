#pragma once

#include <cstdint>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// How much observation i looks like one that sets the maximum gamma:
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

// The observations whose score exceeds `threshold`, without those that bound
// nothing (PruneUnconstrained). Ascending.
std::vector<int64_t> SelectSupport(const KnownRotationProblem& problem,
                                   const std::vector<double>& scores,
                                   double threshold);

// The observations whose lambda exceeds `share` of the largest.
std::vector<int64_t> SelectLarge(const std::vector<Multiplier>& multipliers,
                                 double share);

// All observations of the points that are left when points leave, those with
// the smallest lambdas first, where no frame that moves loses more than `share`
// of its own. What balances with all of them nearly does with these.
std::vector<int64_t> SelectForFrames(const KnownRotationProblem& problem,
                                     const std::vector<Multiplier>& multipliers,
                                     double share);

// The largest part of the `candidates`, ascending, in which the forces of the
// multipliers at `delta` pixels (force_balance.h) balance at every point and
// frame that is not fixed, up to `tolerance` > 0 of the largest delta lambda
// there: what does not is dropped, until everything does, and without those
// that bound nothing.
std::vector<int64_t> SelectBalanced(const KnownRotationProblem& problem,
                                    double delta,
                                    const std::vector<Multiplier>& multipliers,
                                    std::vector<int64_t> candidates,
                                    double tolerance);

// The bound that multipliers would prove, pixels, if (1) of certificate_check.h
// held: the estimate times (1).
double SuggestedBound(const KnownRotationProblem& problem,
                      const Estimate& estimate,
                      const std::vector<Multiplier>& multipliers);

}  // namespace krot::internal
