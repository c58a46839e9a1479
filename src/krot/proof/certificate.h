#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

struct CertificateOptions {
  // The first certificate that proves as much will do, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
  // Supports with more unknowns are not tried; >= 1.
  int max_unknowns = 15000;
};

// A lower bound on every estimate's cost with its proof, from an interior
// point's iterate: positive depths, residuals below gamma, one multiplier per
// observation. Their sum need not prove anything; they only tell which
// observations may set the maximum.
//
// For several thresholds of SupportScores it repairs the multipliers of the
// observations above (of each of their connected components, as each is a
// bound), then those that balance of them (SelectBalanced), then those of
// their own sub-problem, solved, without what does not set its maximum. It
// keeps the highest bound that CheckCertificate accepts. None if there is no
// such. p = 1, 2 or infinity. Allocates as much as a few sub-problems.
std::optional<Certificate> MakeCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    double gamma, const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// The same from the multipliers with which FindFeasible ends where no estimate
// has all its residuals below `bound`, pixels: a certificate near that bound
// from what balances of them (SelectBalanced), for several tolerances.
std::optional<Certificate> MakeInfeasibilityCertificate(
    const KnownRotationProblem& problem, Norm norm, double bound,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// A part's certificate as one of the whole.
Certificate InWhole(const ProblemSubset& part, Certificate certificate);

}  // namespace krot::internal
