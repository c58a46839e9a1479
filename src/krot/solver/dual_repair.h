#pragma once

#include <optional>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/solver/certificate_check.h"

namespace krot {

// Makes multipliers that satisfy the identities (1) and (2) of
// certificate_check.h approximately satisfy them to rounding. The lambda_i
// keep their proportions; y_i moves by lambda_i a_i, with sum |a_i|^2 the
// least, for the delta whose bound delta / max (|y_i|_dual / lambda_i) is the
// largest.
//
// Requires one connected problem, an estimate whose depths are positive (it
// only says what size (2) has) and one multiplier per observation, all
// lambda > 0. None if the unknowns are more than twice the observations, or if
// parts of the problem are flexible. The certificate's observations are those
// of `problem`; its defect is 0, nothing is verified. See least_norm.h for the
// cost.
std::optional<Certificate> RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    const std::vector<Multiplier>& multipliers);

}  // namespace krot
