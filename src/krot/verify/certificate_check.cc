#include "krot/verify/certificate_check.h"

#include <algorithm>
#include <optional>

#include "krot/verify/certificate_input.h"
#include "krot/verify/force_checker.h"

// Of exact multipliers beside the certificate's (force_checker.h),
// |y_i|_dual / lambda_i is at most rho for all i: (lambda_i, y_i / rho) is dual
// feasible and proves delta / rho.

namespace krot::internal {
namespace {

// rho, or why there is none.
std::optional<double> ProveRho(ForceChecker* checker, std::string* refusal) {
  if (auto wrong = checker->Balance()) {
    *refusal = *wrong;
    return std::nullopt;
  }
  const ForceChecker::Constants constants = checker->SumConstants();
  if (!(constants.value + constants.error <= 0)) {
    *refusal = "the constants of its rig rows do not keep their sign";
    return std::nullopt;
  }
  return checker->BoundRho(refusal);
}

}  // namespace

CertificateCheck CheckCertificate(const KnownRotationProblem& problem,
                                  Norm norm, const Certificate& certificate) {
  CertificateCheck check;
  if (auto refusal = RefuseNumbers(problem, norm, certificate)) {
    check.refusal = *refusal;
    return check;
  }
  ForceChecker checker(problem, norm, certificate);
  const std::optional<double> rho = ProveRho(&checker, &check.refusal);
  if (!rho) return check;
  check.defect = std::max(0.0, *rho - 1);
  if (!(*rho - 1 <= certificate.defect)) {
    check.refusal = Sentence(
        "what rounding or a change takes from the bound, relative ", *rho - 1,
        Sentence(", exceeds the ", certificate.defect, " that it states"));
    return check;
  }
  check.is_accepted = true;
  check.changes = checker.Changes();
  check.proved_bound = certificate.lower_bound / *rho * (1 - 4 * kUnitRoundoff);
  return check;
}

}  // namespace krot::internal
