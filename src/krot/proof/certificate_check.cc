#include "krot/proof/certificate_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/LU>

#include "krot/problem/subset.h"
#include "krot/proof/certificate_input.h"
#include "krot/proof/fixed_constants.h"
#include "krot/proof/force_balance.h"
#include "krot/proof/observation_force.h"

// How (1) is proved. Forces (force_balance.h) balance but for g; changing those
// of a spanning forest balances them exactly. The change F_i of a force is one
// of (delta lambda_i; y_i) by E_i^-T F_i. Then |y_i|_dual / lambda_i is at most
// rho for all i, and (lambda_i, y_i / rho) is dual feasible and proves delta /
// rho.

namespace krot {
namespace {

using Real = ObservationForce::Real;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Vector2 = ObservationForce::Vector2;
using Vector3 = ObservationForce::Vector3;

constexpr double kUnitRoundoff = std::numeric_limits<double>::epsilon() / 2;
constexpr Real kRealRoundoff = std::numeric_limits<Real>::epsilon();
constexpr Real kRootTwo = 1.4142135623730951L;  // above it
// Smaller multipliers, relative, might underflow.
constexpr double kSmallestShare = 1e-100;
// No lambda may have to change by more, relative.
constexpr Real kLargestChange = 0.5L;

// The forces at a point or frame, their uncertainty, and what they sum up.
struct Balance {
  Vector3 sum = Vector3::Zero();
  Vector3 terms = Vector3::Zero();
  Real rotation_error = 0;
};

std::vector<int64_t> ObservationsOf(const Certificate& certificate) {
  std::vector<int64_t> observations;
  for (const CertifiedObservation& o : certificate.observations) {
    observations.push_back(o.observation);
  }
  return observations;
}

// Of what RefuseNumbers lets pass.
class Checker {
 public:
  Checker(const KnownRotationProblem& problem, Norm norm,
          const Certificate& certificate)
      : whole_(problem),
        norm_(norm),
        certificate_(certificate),
        part_(problem, ObservationsOf(certificate)) {}

  // The first thing that is wrong, or none.
  std::optional<std::string> Run();

  double rho() const { return rho_; }
  std::vector<MultiplierChange> Changes() const;

 private:
  std::optional<std::string> ScaleMultipliers();
  Imbalance BoundImbalance() const;
  void FindCorrections();
  // Of sums over the support, relative to the sum of absolute values: every
  // term goes through at most 12 roundings, and each sum adds one.
  Real SumError() const {
    return (static_cast<Real>(lambda_.size()) + 12) * kRealRoundoff;
  }
  std::optional<std::string> CheckConstants() const;
  std::optional<std::string> BoundRho();

  const KnownRotationProblem& whole_;
  const Norm norm_;
  const Certificate& certificate_;

  const ProblemSubset part_;  // the support
  std::vector<Real> lambda_;  // of part_, scaled to a maximum in [1/2, 1)
  std::vector<Vector2> y_;
  std::vector<ObservationForce> forces_;
  std::vector<Compliance> compliances_;
  std::vector<Real> corrections_;  // bound |F_i|
  double rho_ = 0;
};

std::optional<std::string> Checker::ScaleMultipliers() {
  double largest = 0;
  for (const CertifiedObservation& o : certificate_.observations) {
    largest = std::max(largest, o.lambda);
  }
  int exponent = 0;
  std::frexp(largest, &exponent);
  for (const CertifiedObservation& o : certificate_.observations) {
    if (o.lambda < kSmallestShare * largest) {
      return "its multipliers differ by more than 100 decades";
    }
    const Observation& observation = whole_.observations[o.observation];
    lambda_.push_back(std::ldexp(Real{o.lambda}, -exponent));
    y_.push_back({std::ldexp(Real{o.y[0]}, -exponent),
                  std::ldexp(Real{o.y[1]}, -exponent)});
    forces_.push_back(MakeForce(observation, y_.back(),
                                certificate_.lower_bound * lambda_.back()));
    compliances_.push_back(MakeCompliance(observation));
    if (!forces_.back().terms.allFinite() ||
        !std::isfinite(compliances_.back().y) ||
        !std::isfinite(compliances_.back().delta_lambda)) {
      return "a ray of its observations is no finite number";
    }
  }
  return RefuseRotations(part_.problem());
}

// Of forces turned into the world by rotations known to kRotationError.
Imbalance Checker::BoundImbalance() const {
  const KnownRotationProblem& problem = part_.problem();
  std::vector<Balance> of_point(problem.num_points);
  std::vector<Balance> of_frame(problem.num_frames);
  for (size_t i = 0; i < forces_.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    const Matrix3 world_from_cam =
        view.cam_from_world_rotation.transpose().cast<Real>();
    const Vector3 force = world_from_cam * forces_[i].sum;
    const Vector3 terms = world_from_cam.cwiseAbs() * forces_[i].terms;
    for (Balance* balance :
         {&of_point[observation.point], &of_frame[view.frame]}) {
      balance->sum += force;
      balance->terms += terms;
      balance->rotation_error += kRotationError * forces_[i].terms.sum();
    }
  }
  const auto bound = [&](const Balance& balance) -> Real {
    const Vector3 sum = balance.sum.cwiseAbs() + SumError() * balance.terms +
                        Vector3::Constant(balance.rotation_error);
    return sum.norm() * kOutward;
  };
  Imbalance imbalance;
  for (const Balance& b : of_point) imbalance.of_point.push_back(bound(b));
  for (const Balance& b : of_frame) imbalance.of_frame.push_back(bound(b));
  return imbalance;
}

void Checker::FindCorrections() {
  std::vector<Real> strength;
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Compliance& compliance = compliances_[i];
    strength.push_back(lambda_[i] /
                       std::max(compliance.y, compliance.delta_lambda /
                                                  certificate_.lower_bound));
  }
  corrections_ = BoundCorrections(part_.problem(), strength, BoundImbalance());
}

// (2), once every frame's origin has moved to the projection centre of the
// first of its views that the support sees: t_f + R_sr^-1 t_sr of that view is
// the unknown as well as t_f is. If each frame has one centre, the constants
// are gone; the others are force times offset of the centre. What is fixed has
// its own (fixed_constants.h).
std::optional<std::string> Checker::CheckConstants() const {
  const KnownRotationProblem& problem = part_.problem();
  const FixedConstants fixed(problem);
  std::vector<int32_t> first_view(problem.num_frames, -1);
  Real kappa = 0;
  Real kappa_error = 0;
  for (size_t i = 0; i < forces_.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    int32_t& first = first_view[view.frame];
    if (first < 0) first = observation.view;
    const FixedConstants::Part of_point =
        fixed.OfPoint(view, observation.point);
    Vector3 offset = of_point.x_cam;
    Real size = of_point.size;
    if (fixed.IsAwayFromOrigin(view.frame)) {
      const FixedConstants::Part of_frame = fixed.OfFrame(view);
      offset += of_frame.x_cam;
      size += of_frame.size;
    } else if (first != observation.view) {
      const Vector3 t = view.cam_from_rig_translation.cast<Real>();
      const Vector3 t_first =
          problem.views[first].cam_from_rig_translation.cast<Real>();
      offset +=
          t -
          view.cam_from_rig_rotation.cast<Real>() *
              Matrix3(problem.views[first].cam_from_rig_rotation.cast<Real>())
                  .inverse() *
              t_first;
      size += t.cwiseAbs().sum() + t_first.cwiseAbs().sum();
    }
    const Real offset_error = 16 * kRotationError * size;
    kappa += forces_[i].sum.dot(offset);
    kappa_error += forces_[i].terms.sum() * offset_error +
                   forces_[i].terms.dot(offset.cwiseAbs()) * SumError() +
                   corrections_[i] * (offset.cwiseAbs().sum() + offset_error);
  }
  if (kappa + kappa_error * kOutward <= 0) return std::nullopt;
  return "the constants of its rig rows do not keep their sign";
}

// A vector of some length has the longest dual norm along the diagonal, for
// p = infinity: sqrt(2) of it.
std::optional<std::string> Checker::BoundRho() {
  const Real per_length = norm_.p == 1 || norm_.p == 2 ? 1 : kRootTwo;
  Real rho = 0;
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Real correction = corrections_[i] / lambda_[i] * kOutward;
    const Real change =
        correction * compliances_[i].delta_lambda / certificate_.lower_bound;
    if (!(change < kLargestChange)) {
      return "its multipliers do not balance at a point or a frame";
    }
    const Real length = DualNorm(y_[i], norm_) / lambda_[i];
    const Real longer = correction * compliances_[i].y * per_length;
    rho = std::max(rho, (length + longer) / (1 - change));
  }
  rho_ = static_cast<double>(rho) * (1 + 4 * kUnitRoundoff);
  return std::nullopt;
}

std::vector<MultiplierChange> Checker::Changes() const {
  std::vector<MultiplierChange> changes;
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Real unit = certificate_.observations[i].lambda / lambda_[i];
    const Real correction = corrections_[i] * kOutward * kOutward;
    changes.push_back(
        {static_cast<double>(correction * unit * compliances_[i].y),
         static_cast<double>(correction * compliances_[i].delta_lambda /
                             (lambda_[i] * certificate_.lower_bound))});
  }
  return changes;
}

std::optional<std::string> Checker::Run() {
  if (auto refusal = ScaleMultipliers()) return refusal;
  FindCorrections();
  if (auto refusal = CheckConstants()) return refusal;
  if (auto refusal = BoundRho()) return refusal;
  const double defect = rho_ - 1;
  if (!(defect <= certificate_.defect)) {
    return Sentence(
        "what rounding or a change takes from the bound, relative ", defect,
        Sentence(", exceeds the ", certificate_.defect, " that it states"));
  }
  return std::nullopt;
}

}  // namespace

CertificateCheck CheckCertificate(const KnownRotationProblem& problem,
                                  Norm norm, const Certificate& certificate) {
  CertificateCheck check;
  if (auto refusal = RefuseNumbers(problem, norm, certificate)) {
    check.refusal = *refusal;
    return check;
  }
  Checker checker(problem, norm, certificate);
  if (auto refusal = checker.Run()) {
    check.refusal = *refusal;
    check.defect = std::max(0.0, checker.rho() - 1);
    return check;
  }
  check.is_accepted = true;
  check.changes = checker.Changes();
  check.proved_bound =
      certificate.lower_bound / checker.rho() * (1 - 4 * kUnitRoundoff);
  check.defect = std::max(0.0, checker.rho() - 1);
  return check;
}

}  // namespace krot
