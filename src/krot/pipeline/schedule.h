#pragma once

#include <optional>

#include "krot/pipeline/solve_model.h"

namespace krot {

// Runs the stages of `method` on an estimate of positive depths. Fills in the
// termination, the costs, the sweeps and the iterations of the summary and
// returns the certificate of the joint solver, if it has one. The cost rises by
// rounding at most.
std::optional<Certificate> RunSchedule(const KnownRotationProblem& problem,
                                       const SolveModelOptions& options,
                                       SolveMethod method, Estimate* estimate,
                                       SolveSummary* summary);

}  // namespace krot
