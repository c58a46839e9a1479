#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/pipeline/round_bounds.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// A lower bound in true pixels for all estimates, from the observations that
// set the maximum of the linear rows: `support`, ascending indices. `built` has
// the rows that were taken at `x_hat`; the nearer that is to the optimum of the
// true errors, the higher is the bound.
//
// The support's own problem, which is small, is solved once more for these
// rows; a row whose support line (pixel_certificate.h) is crossed by its
// observation's true set is widened until it is not, and the problem solved
// again, until the bound is `sufficient`, pixels. None if nothing is proved.
std::optional<PixelCertificate> ProveInPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat, Norm norm,
                                              std::vector<int64_t> support,
                                              double sufficient,
                                              const Context& context);

// The same from a certificate of the rows that were solved. Where rows do not
// depend on where they are taken it is that certificate's own. Where ranks
// share the points the first one has the result, in the numbers of the whole
// (gathered_support.h), the others its lower bound. Of the options it takes
// norm and checkpoint: it is a step.
std::optional<PixelCertificate> ProveRows(
    const Model& model, const BuiltProblem& built, const Estimate& x_hat,
    const SolveModelOptions& options, const RowsCertificate& rows,
    double sufficient, const Context& context);

// The observations of a certificate, by what they are called in the whole;
// those that are not there are left out.
std::vector<int64_t> SupportOf(const RowsCertificate& rows);

}  // namespace krot::internal
