#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/solve.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// Those of a certificate, whose rows those of built.problem are, with the
// largest share first.
std::vector<SupportPosition> ListSupportPositions(
    const Model& model, const BuiltProblem& built, const Estimate& estimate,
    const PixelCertificate& certificate);

// The observations in the support of a certificate of built.problem, worst
// first.
std::vector<SupportObservation> ListSupport(const Model& model,
                                            const BuiltProblem& built,
                                            const Estimate& estimate, Norm norm,
                                            const Certificate& certificate);

}  // namespace krot::internal
