#pragma once

#include <optional>

#include "krot/base/timer.h"
#include "krot/pipeline/solve_model.h"

namespace krot {

// Runs the stages of `method` on an estimate of positive depths. Fills in the
// termination, the costs, the sweeps and the iterations of the summary, with
// the seconds of `timer`, and returns the certificate of the joint solver, if
// it has one. The cost rises by rounding at most.
std::optional<Certificate> RunSchedule(const KnownRotationProblem& problem,
                                       const SolveModelOptions& options,
                                       SolveMethod method,
                                       const Context& context,
                                       const Timer& timer, Estimate* estimate,
                                       SolveSummary* summary);

}  // namespace krot
