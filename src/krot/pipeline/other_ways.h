#pragma once

#include <optional>

#include "krot/base/timer.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/context.h"
#include "krot/pipeline/solve_model.h"
#include "krot/pipeline/start.h"

namespace krot::internal {

// After SolveInRounds, where that stalled far from any bound: the other ways to
// the optimum, joint iterations alone from the model's own start and rounds
// from a start that is found from nothing, until one is proved; the former come
// first where that start has points in cameras. Leaves the
// estimate of the least true cost, its problem, and the highest certificate;
// appends to the summary's rounds, sweeps and iterations. Each way may take a
// hundred iterations, or as many as the solve has taken.
void TryOtherWays(const Model& model, const SolveModelOptions& options,
                  const Context& context, const Timer& timer, Start* start,
                  Estimate* estimate,
                  std::optional<PixelCertificate>* certificate,
                  SolveSummary* summary);

}  // namespace krot::internal
