#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "krot/base/progress.h"
#include "krot/conic/interior_point.h"
#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/solver/certificate_check.h"

namespace krot {

struct CertificateOptions {
  // The first certificate that proves as much will do, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
  // Supports with more unknowns are not tried; >= 1.
  int max_unknowns = 15000;
  int num_threads = -1;                // -1: all
  const CancelFlag* cancel = nullptr;  // may be null
};

// A lower bound on every estimate's cost with its proof, from an interior
// point's iterate: positive depths, residuals below gamma, one multiplier per
// observation. Their sum need not prove anything; they only tell which
// observations may set the maximum.
//
// For several thresholds of SupportScores it solves the sub-problem of the
// observations above (each of its connected components, as each is a bound),
// drops what does not set that one's maximum, repairs the multipliers, and
// keeps the highest bound that CheckCertificate accepts. None if there is no
// such. p = 1, 2 or infinity. Allocates as much as a few sub-problems.
std::optional<Certificate> MakeCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    double gamma, const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options);

}  // namespace krot
