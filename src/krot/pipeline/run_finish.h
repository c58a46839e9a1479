#pragma once

#include "krot/base/context.h"
#include "krot/base/timer.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/reprojection.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// An estimate that is nearer to the cap, relative, leaves no room for a finish.
inline constexpr double kLeastRoom = 1e-6;

// Takes an estimate whose largest true error is as low as it gets to the end
// that the options ask for:
//
//   least squares   of true errors, below a cap: max_error or, if there is
//                   none, (1 + slack) times the lowest maximum (`lower_bound`
//                   if the gap asked for is reached and at most half of the
//                   slack, else the estimate's own), but no more than the
//                   start's largest
//   sweeps          two, that do not raise the largest true error; they count
//                   among the summary's
//
// Fills in SolveSummary::finish if least squares were found. The rows of
// `built` are in the end those at `*estimate`.
void RunFinish(const Model& model, const SolveModelOptions& options,
               std::optional<double> lower_bound, const Context& context,
               const Timer& timer, BuiltProblem* built, Estimate* estimate,
               SolveSummary* summary);

// Half the sum of the losses of the true errors, squared pixels: what the least
// squares have lowered. O(observations).
double SumOfLosses(const Reprojection& reprojection,
                   const KnownRotationProblem& problem, const ErrorLoss& loss,
                   const Estimate& estimate, const Context& context);

}  // namespace krot::internal
