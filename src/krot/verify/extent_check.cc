#include "krot/verify/extent_check.h"

#include <cmath>
#include <limits>
#include <optional>

#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {
namespace {

using Real = ForceChecker::Real;
using Vector3 = ForceChecker::Vector3;

// Covers the rounding of the extent, relative: half of it is for the cast to
// double, the rest is enough for the sum in long double.
constexpr Real kCastError = std::numeric_limits<double>::epsilon();

// Whether each component of the support has something fixed. Then gradients
// that cancel at all that is not fixed need not cancel in total.
bool HoldsFixed(const KnownRotationProblem& problem,
                const Certificate& certificate) {
  std::vector<int64_t> support;
  for (const CertifiedObservation& o : certificate.observations) {
    support.push_back(o.observation);
  }
  for (auto& component : SplitIntoComponents(problem, std::move(support))) {
    if (!HasFixed(ProblemSubset(problem, std::move(component)).problem())) {
      return false;
    }
  }
  return true;
}

ExtentCheck Refused(const std::string& refusal) {
  ExtentCheck check;
  check.refusal = refusal;
  return check;
}

}  // namespace

ExtentCheck CheckExtent(const KnownRotationProblem& problem, Norm norm,
                        const ExtentCertificate& certificate) {
  const Certificate rows{certificate.bound, 0, certificate.observations};
  if (auto refusal = RefuseNumbers(problem, norm, rows)) {
    return Refused(*refusal);
  }
  if (!HoldsFixed(problem, rows)) return Refused("nothing fixed holds it");
  ForceChecker checker(problem, norm, rows, certificate.pulls);
  if (auto refusal = checker.Balance()) return Refused(*refusal);
  ExtentCheck check;
  const std::optional<double> rho = checker.BoundRho(&check.refusal);
  if (!rho) return check;
  if (!(*rho <= 1)) {
    return Refused(
        Sentence("balance takes y to ", *rho, " times the length of lambda"));
  }
  // kappa bounds positions relative to the origin of the constants, so that
  // origin is added; the error of kappa covers its cast, too.
  const ForceChecker::Constants constants = checker.SumConstants();
  Real extent = constants.value + constants.error;
  for (const Pull& pull : certificate.pulls) {
    const Vector3 direction = pull.direction.cast<Real>();
    extent += direction.dot(constants.origin);
    extent +=
        direction.cwiseAbs().dot(constants.origin.cwiseAbs()) * kCastError;
    extent += direction.cwiseAbs().sum() * constants.origin_error;
  }
  check.extent = static_cast<double>(extent);
  check.is_accepted = std::isfinite(check.extent);
  if (!check.is_accepted) check.refusal = "its extent is no finite number";
  return check;
}

double BalancingPull(const KnownRotationProblem& problem,
                     const ExtentCertificate& certificate, const Pull& keeper) {
  const bool is_view = keeper.kind == Pull::Kind::kView;
  // The frame of the view, or the point: what moves as one with the keeper.
  const auto node = [&](int32_t view, int32_t point) {
    return is_view ? problem.views[view].frame : point;
  };
  const int32_t own = node(is_view ? keeper.index : 0, keeper.index);
  Vector3 sum = Vector3::Zero();
  for (const CertifiedObservation& o : certificate.observations) {
    const Observation& observation = problem.observations[o.observation];
    if (node(observation.view, observation.point) != own) continue;
    sum += problem.views[observation.view]
               .cam_from_world_rotation.transpose()
               .cast<Real>() *
           MakeForce(observation, o.y.cast<Real>(),
                     Real{certificate.bound} * o.lambda)
               .sum;
  }
  if (!is_view) sum = -sum;
  for (const Pull& pull : certificate.pulls) {
    if (pull.kind != keeper.kind ||
        node(is_view ? pull.index : 0, pull.index) != own) {
      continue;
    }
    sum -= pull.direction.cast<Real>();
  }
  const Vector3 n = keeper.direction.cast<Real>();
  return static_cast<double>(n.dot(sum) / n.squaredNorm());
}

}  // namespace krot::internal
