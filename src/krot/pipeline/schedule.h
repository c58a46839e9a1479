#pragma once

#include <optional>

#include "krot/base/context.h"
#include "krot/base/timer.h"
#include "krot/pipeline/solve_model.h"

namespace krot {

// One round: the stages of `method` on the linear rows of a problem, from an
// estimate of positive depths. Adds to the sweeps and the iterations of the
// summary, with the seconds of `timer`, and sets its termination. Returns the
// certificate of the joint solver, if it has one. The rows' cost rises by
// rounding at most. Only the first round of kAuto looks for another start.
std::optional<Certificate> SolveRows(const KnownRotationProblem& problem,
                                     const SolveModelOptions& options,
                                     SolveMethod method, bool is_first_round,
                                     const Context& context, const Timer& timer,
                                     Estimate* estimate, SolveSummary* summary);

// Behind the last round of kAuto: lowers every block's own maximum. Returns
// whether a sweep was taken, whose rows' cost is at most `highest`, pixels.
bool SweepToFinish(const KnownRotationProblem& problem,
                   const SolveModelOptions& options, const Context& context,
                   double highest, Estimate* estimate);

}  // namespace krot
