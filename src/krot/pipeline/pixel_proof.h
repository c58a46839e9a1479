#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// A certificate of rows. observation_of maps indices of its rows to those of
// the whole problem's observations; -1 marks a row that is no observation;
// empty means identity.
struct RowsCertificate {
  Certificate certificate;
  std::vector<int64_t> observation_of;
};

// A lower bound in true pixels for all estimates, from the observations that
// set the maximum of the linear rows: `support`, ascending indices. `built` has
// the rows that were taken at `x_hat`; the nearer that is to the optimum of the
// true errors, the higher is the bound.
//
// Solves the problem of the support alone, which is small, for these rows. If a
// row's support line (pixel_certificate.h) cuts the set of rays whose true
// error is within the bound, the row is widened and the problem solved again,
// until the bound is `sufficient`, pixels. None if nothing is proved.
std::optional<PixelCertificate> ProveInPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat, Norm norm,
                                              std::vector<int64_t> support,
                                              double sufficient,
                                              const Context& context);

// The same from a certificate of the rows that were solved. Where rows do not
// depend on where they are taken, as for pinholes, that certificate is itself
// the proof. Where ranks share the points, the first one returns the result,
// with indices of the whole problem (certificate_file.h), and the others only
// its lower bound. It is one step of the checkpoint; of the options it uses
// norm and checkpoint.
std::optional<PixelCertificate> ProveRows(
    const Model& model, const BuiltProblem& built, const Estimate& x_hat,
    const SolveModelOptions& options, const RowsCertificate& rows,
    double sufficient, const Context& context);

// The observations of a certificate, as indices of the whole problem; rows that
// are no observations are left out.
std::vector<int64_t> SupportOf(const RowsCertificate& rows);

// Checks a certificate independently of the solver that made it, and writes to
// the summary what it proves about the estimate. Where ranks share the points
// all must call it, and only the first one's summary is filled in.
void Certify(const Model& model, const BuiltProblem& built,
             const Estimate& estimate, const SolveModelOptions& options,
             const Context& context,
             std::optional<PixelCertificate> certificate,
             SolveSummary* summary);

// Certifies, in true pixels, that no estimate is below the bound of a start
// from nothing; `certificate` is what FindFeasibleStart returned.
void CertifyInfeasible(const Model& model, const BuiltProblem& built,
                       const SolveModelOptions& options, const Context& context,
                       const std::optional<Certificate>& certificate,
                       SolveSummary* summary);

}  // namespace krot::internal
