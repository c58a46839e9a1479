#pragma once

#include <functional>
#include <optional>

#include "krot/base/context.h"
#include "krot/base/timer.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// One round: the stages of `method` on the linear rows of a problem, from an
// estimate of positive depths. Adds to the sweeps and the iterations of the
// summary, with the seconds of `timer`, and sets its termination. Returns the
// certificate of the joint solver, if it has one. The rows' cost rises by
// rounding at most. Only the first round of kAuto looks for another start.
// kAuto ends with its sweeps, as kStalled, where `have_rows_served` says of
// their estimate and the rows' cost, pixels, that it is better to take the rows
// anew; may be empty.
std::optional<Certificate> SolveRows(
    const KnownRotationProblem& problem, const SolveModelOptions& options,
    SolveMethod method, bool is_first_round,
    const std::function<bool(const Estimate& swept, double linear_cost)>&
        have_rows_served,
    const Context& context, const Timer& timer, Estimate* estimate,
    KnownMultipliers* known, SolveSummary* summary);

}  // namespace krot::internal
