#pragma once

#include <optional>

#include "krot/base/context.h"
#include "krot/base/timer.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// Minimises the largest *true* error in rounds: takes every row where its point
// projects, solves the linear problem (SolveRows), goes as far along the way to
// its solution as lowers the true cost most, and takes the rows anew, until a
// certificate in true pixels shows the gap asked for or a round lowers nothing.
// A fixed point satisfies the first-order conditions of the true problem. One
// round where rows do not depend on where they are taken.
//
// The true cost never rises. Where a full step would raise it, the next round
// bounds how far the observations to blame may move (trust_regions.h).
//
// Where positions are known (krot/bridge/position_rows.h) every round has a
// level, and what falls is the cost at that; the result is the best estimate
// that keeps them, or kInfeasible with a proof that none does below
// options.init_max_error.
//
// Fills in costs, rounds, termination, sweeps and iterations of the summary and
// returns the highest certificate, unchecked. The rows of `built` are in the
// end those at `*estimate`.
std::optional<PixelCertificate> SolveInRounds(
    const Model& model, const SolveModelOptions& options, SolveMethod method,
    const Context& context, const Timer& timer, BuiltProblem* built,
    Estimate* estimate, SolveSummary* summary);

}  // namespace krot::internal
