#include "krot/verify/certificate_check.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "krot/problem/subset.h"
#include "krot/verify/force_checker.h"

// There are exact multipliers near the certificate's (force_checker.h) with
// |y_i|_dual / lambda_i at most rho for all i. So (lambda_i, y_i / rho) is dual
// feasible and proves delta / rho.

namespace krot::internal {
namespace {

using Real = long double;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;

}  // namespace

std::string Sentence(const std::string& start, double value,
                     const std::string& end) {
  std::ostringstream text;
  text.precision(17);
  text << start << value << end;
  return text.str();
}

std::optional<std::string> RefuseNumbers(const KnownRotationProblem& problem,
                                         Norm norm,
                                         const Certificate& certificate) {
  if (norm.p != 2 && !norm.IsPolyhedral()) {
    return Sentence("there are no certificates for p = ", norm.p, "");
  }
  const double bound = certificate.lower_bound;
  if (!(bound > 0) || !std::isfinite(bound)) {
    return Sentence("the lower bound is ", bound, ", must be positive");
  }
  const double defect = certificate.defect;
  if (!(defect >= 0 && defect <= kMaxDefect)) {
    return Sentence("the defect is ", defect, ", must be in [0, 1e-6]");
  }
  if (certificate.observations.empty()) return "it holds no observation";
  const int64_t count = static_cast<int64_t>(problem.observations.size());
  int64_t previous = -1;
  for (const CertifiedObservation& o : certificate.observations) {
    if (o.observation <= previous || o.observation >= count) {
      return "its observations do not ascend or are not the problem's";
    }
    previous = o.observation;
    const std::string which =
        "the multipliers of observation " + std::to_string(o.observation);
    if (!std::isfinite(o.lambda) || !o.y.allFinite() || !(o.lambda > 0)) {
      return which + " are not finite, or lambda is not positive";
    }
    if (!(DualNorm<Real>(o.y.cast<Real>(), norm) <= o.lambda * (1 + 1e-12))) {
      return which + " are infeasible: y is longer than lambda";
    }
  }
  return std::nullopt;
}

std::optional<std::string> RefuseRotations(
    const KnownRotationProblem& problem) {
  std::vector<const View*> first_view(problem.num_frames);
  for (const View& view : problem.views) {
    const Matrix3 R_sr = view.cam_from_rig_rotation.cast<Real>();
    const Matrix3 R_cw = view.cam_from_world_rotation.cast<Real>();
    for (const Matrix3& R : {R_sr, R_cw}) {
      const Real error =
          (R.transpose() * R - Matrix3::Identity()).cwiseAbs().maxCoeff();
      if (!(error <= 1e-12)) return "a rotation of its views is none";
    }
    const View*& first = first_view[view.frame];
    if (!first) first = &view;
    const Matrix3 R_rw =
        Matrix3(first->cam_from_rig_rotation.cast<Real>()).inverse() *
        first->cam_from_world_rotation.cast<Real>();
    if (!((R_cw - R_sr * R_rw).cwiseAbs().maxCoeff() <= kRotationError)) {
      return "the rotations of a frame's views contradict each other";
    }
  }
  return std::nullopt;
}

namespace {

// Returns rho, or none and the reason.
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

namespace {

using Vector3 = ForceChecker::Vector3;

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
    // Covers rounding: half of it is for the cast to double, the rest is enough
    // for the sum in long double.
    extent += direction.cwiseAbs().dot(constants.origin.cwiseAbs()) *
              (2 * kUnitRoundoff);
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
