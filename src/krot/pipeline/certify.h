#pragma once

#include <optional>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// Checks a certificate once more, apart from the solver that made it, and says
// in the summary what it proves about the estimate. Where ranks share the
// points all call it, and the first one's summary has it.
void Certify(const Model& model, const BuiltProblem& built,
             const Estimate& estimate, const SolveModelOptions& options,
             const Context& context,
             std::optional<PixelCertificate> certificate,
             SolveSummary* summary);

// That no estimate is below a start's bound, in true pixels.
void CertifyInfeasible(const Model& model, const BuiltProblem& built,
                       const SolveModelOptions& options, const Context& context,
                       const std::optional<Certificate>& certificate,
                       SolveSummary* summary);

}  // namespace krot::internal
