#pragma once

#include <cstdint>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

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

}  // namespace krot
