#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/certificate_check.h"

namespace krot {

struct RepairOptions {
  int num_threads = 1;
  // It ends with the first multipliers that prove as much, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
};

// Makes multipliers that satisfy the identities (1) and (2) of
// certificate_check.h approximately for `delta` > 0, pixels, satisfy them to
// rounding. It goes to and fro between the least change, relative and in a
// metric in which lengthening y_i / lambda_i costs more than turning it, that
// restores (1) and (2), and the nearest multipliers with |y_i|_dual <=
// lambda_i. Where the two do not meet, y is divided by the largest
// |y_i|_dual / lambda_i, and what is proved is delta by as much smaller.
//
// Requires one connected problem and one multiplier per observation, all
// lambda > 0. See least_norm.h for the cost.
struct RepairedMultipliers {
  // Its observations are those of the problem; its defect is 0, nothing is
  // verified. None if the equations cannot be solved, or if there are misfits.
  std::optional<Certificate> certificate;
  // The observations whose lambda would have to change by more than half: the
  // others may balance without them. Ascending.
  std::vector<int64_t> misfits;
};

RepairedMultipliers RepairMultipliers(
    const KnownRotationProblem& problem, Norm norm, double delta,
    const std::vector<Multiplier>& multipliers,
    const RepairOptions& options = {});

}  // namespace krot
