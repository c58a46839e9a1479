#include "krot/verify/force_checker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "krot/geometry.h"
#include "krot/problem/cost.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

using Eigen::Vector3d;

Vector3d PositionOf(const KnownRotationProblem& problem,
                    const Estimate& estimate, const Pull& pull) {
  if (pull.kind == Pull::Kind::kPoint) return estimate.points[pull.index];
  const View& view = problem.views[pull.index];
  return Center({view.cam_from_world_rotation,
                 CamFromWorld(view, estimate.translations[view.frame]).col(3)});
}

double Along(const KnownRotationProblem& problem, const Estimate& estimate,
             const Pull& pull) {
  return pull.direction.dot(PositionOf(problem, estimate, pull));
}

bool IsFixedPosition(const KnownRotationProblem& problem, const Pull& pull) {
  return pull.kind == Pull::Kind::kPoint
             ? problem.IsFixedPoint(pull.index)
             : problem.IsFixedFrame(problem.views[pull.index].frame);
}

std::optional<Pull> InPart(const ProblemSubset& part, const Pull& pull) {
  const std::optional<int32_t> index = pull.kind == Pull::Kind::kPoint
                                           ? part.FindPoint(pull.index)
                                           : part.FindView(pull.index);
  if (!index) return std::nullopt;
  return Pull{pull.kind, *index, pull.direction};
}

namespace {

using Real = ForceChecker::Real;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Vector2 = ForceChecker::Vector2;
using Vector3 = ForceChecker::Vector3;

// The sum of forces at a point or frame, and the sum of the absolute values of
// their terms.
struct NodeBalance {
  Vector3 sum = Vector3::Zero();
  Real terms = 0;
};

std::vector<int64_t> ObservationsOf(const Certificate& certificate) {
  std::vector<int64_t> observations;
  for (const CertifiedObservation& o : certificate.observations) {
    observations.push_back(o.observation);
  }
  return observations;
}

}  // namespace

ForceChecker::ForceChecker(const KnownRotationProblem& problem, Norm norm,
                           const Certificate& certificate,
                           std::vector<Pull> pulls)
    : whole_(problem),
      norm_(norm),
      certificate_(certificate),
      pulls_(std::move(pulls)),
      part_(problem, ObservationsOf(certificate)) {}

std::optional<std::string> ForceChecker::ScaleMultipliers() {
  double largest = 0;
  for (const CertifiedObservation& o : certificate_.observations) {
    largest = std::max(largest, o.lambda);
  }
  std::frexp(largest, &exponent_);
  for (const CertifiedObservation& o : certificate_.observations) {
    if (o.lambda < 1e-100 * largest) {  // it might underflow
      return "its multipliers differ by more than 100 decades";
    }
    const Observation& observation = whole_.observations[o.observation];
    lambda_.push_back(std::ldexp(Real{o.lambda}, -exponent_));
    y_.push_back({std::ldexp(Real{o.y[0]}, -exponent_),
                  std::ldexp(Real{o.y[1]}, -exponent_)});
    forces_.push_back(MakeForce(observation, y_.back(),
                                certificate_.lower_bound * lambda_.back()));
    const std::optional<Compliance> compliance = MakeCompliance(observation);
    if (!compliance) return "a ray of its observations is no finite number";
    compliances_.push_back(*compliance);
  }
  return RefuseRotations(part_.problem());
}

// Checks the pulls and replaces their indices by those of the support.
std::optional<std::string> ForceChecker::PlacePulls() {
  for (Pull& pull : pulls_) {
    if (!pull.direction.allFinite()) return "a pull is no finite number";
    const int64_t count = pull.kind == Pull::Kind::kPoint
                              ? whole_.num_points
                              : static_cast<int64_t>(whole_.views.size());
    if (pull.index < 0 || pull.index >= count) {
      return "it pulls at what is not there";
    }
    if (IsFixedPosition(whole_, pull)) return "it pulls at what is fixed";
    const std::optional<Pull> placed = InPart(part_, pull);
    if (!placed) return "its support does not hold what is pulled";
    pull = *placed;
  }
  return std::nullopt;
}

// A bound on the relative error of sums over the support and the pulls.
Real ForceChecker::ErrorOfSums() const {
  return ForceError(forces_.size() + pulls_.size());
}

Imbalance ForceChecker::BoundImbalance() const {
  const KnownRotationProblem& problem = part_.problem();
  std::vector<NodeBalance> of_point(problem.num_points);
  std::vector<NodeBalance> of_frame(problem.num_frames);
  for (size_t i = 0; i < forces_.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    const Matrix3 world_from_cam =
        view.cam_from_world_rotation.transpose().cast<Real>();
    const Vector3 force = world_from_cam * forces_[i].sum;
    for (NodeBalance* balance :
         {&of_point[observation.point], &of_frame[view.frame]}) {
      balance->sum += force;
      balance->terms += forces_[i].terms.sum();
    }
  }
  const Real scale = std::ldexp(Real{1}, -exponent_);
  for (const Pull& pull : pulls_) {
    const Vector3 direction = scale * pull.direction.cast<Real>();
    const bool is_view = pull.kind == Pull::Kind::kView;
    NodeBalance* balance = is_view ? &of_frame[problem.views[pull.index].frame]
                                   : &of_point[pull.index];
    balance->sum += is_view ? Vector3(-direction) : direction;
    balance->terms += direction.cwiseAbs().sum();
  }
  const auto bound = [&](const NodeBalance& balance) -> Real {
    return balance.sum.norm() + ErrorOfSums() * balance.terms;
  };
  Imbalance imbalance;
  for (const NodeBalance& b : of_point) imbalance.of_point.push_back(bound(b));
  for (const NodeBalance& b : of_frame) imbalance.of_frame.push_back(bound(b));
  return imbalance;
}

void ForceChecker::FindCorrections() {
  std::vector<Real> strength;
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Compliance& compliance = compliances_[i];
    strength.push_back(lambda_[i] /
                       std::max(compliance.y, compliance.delta_lambda /
                                                  certificate_.lower_bound));
  }
  corrections_ = BoundCorrections(part_.problem(), strength, BoundImbalance());
}

std::optional<std::string> ForceChecker::Balance() {
  if (auto refusal = ScaleMultipliers()) return refusal;
  if (auto refusal = PlacePulls()) return refusal;
  FindCorrections();
  return std::nullopt;
}

std::vector<std::optional<int32_t>> ForceChecker::FirstViews() const {
  const KnownRotationProblem& problem = part_.problem();
  std::vector<std::optional<int32_t>> first_views(problem.num_frames);
  for (const Observation& observation : problem.observations) {
    std::optional<int32_t>& first =
        first_views[problem.views[observation.view].frame];
    if (!first) first = observation.view;
  }
  return first_views;
}

FixedConstants::Part ForceChecker::FromFirstView(int32_t view,
                                                 int32_t first) const {
  if (view == first) return {};
  const View& own = part_.problem().views[view];
  const View& reference = part_.problem().views[first];
  const Vector3 t = own.cam_from_rig_translation.cast<Real>();
  const Vector3 t_first = reference.cam_from_rig_translation.cast<Real>();
  return {
      t - own.cam_from_rig_rotation.cast<Real>() *
              Matrix3(reference.cam_from_rig_rotation.cast<Real>()).inverse() *
              t_first,
      t.cwiseAbs().sum() + t_first.cwiseAbs().sum()};
}

// If rotations are known to kRotationError, an offset has an error of at most 5
// times that, times its size, and a rotated pull of 2 times that; a correction
// is less than half of the force's terms (BoundRho). So 16 times kRotationError
// covers the error of the offsets in all products, and all rounding.
ForceChecker::Constants ForceChecker::SumConstants() const {
  const KnownRotationProblem& problem = part_.problem();
  const FixedConstants fixed(problem);
  const std::vector<std::optional<int32_t>> first_views = FirstViews();
  const Real relative_error = 8 * ErrorOfSums();
  Constants constants;
  constants.origin = fixed.origin();
  constants.origin_error = relative_error * fixed.origin_size();
  for (size_t i = 0; i < forces_.size(); ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    const FixedConstants::Part of_point =
        fixed.OfPoint(view, observation.point);
    const FixedConstants::Part of_frame =
        fixed.IsAwayFromOrigin(view.frame)
            ? fixed.OfFrame(view)
            : FromFirstView(observation.view, *first_views[view.frame]);
    const Vector3 offset = of_point.x_cam + of_frame.x_cam;
    const Real size = of_point.size + of_frame.size;
    constants.value += forces_[i].sum.dot(offset);
    constants.error += forces_[i].terms.sum() * relative_error * size +
                       corrections_[i] * offset.cwiseAbs().sum();
  }
  const Real scale = std::ldexp(Real{1}, -exponent_);
  for (const Pull& pull : pulls_) {
    if (pull.kind != Pull::Kind::kView) continue;
    const View& view = problem.views[pull.index];
    const FixedConstants::Part in_frame =
        FromFirstView(pull.index, *first_views[view.frame]);
    const Vector3 direction =
        scale * (view.cam_from_world_rotation.cast<Real>() *
                 pull.direction.cast<Real>());
    constants.value -= direction.dot(in_frame.x_cam);
    constants.error +=
        direction.cwiseAbs().sum() * relative_error * in_frame.size;
  }
  constants.value = std::ldexp(constants.value, exponent_);
  constants.error = std::ldexp(constants.error, exponent_);
  return constants;
}

// The dual norm of a vector is at most its length, except for p = infinity:
// then it is at most sqrt(2) times the length, reached along the diagonal.
std::optional<double> ForceChecker::BoundRho(std::string* refusal) const {
  const Real per_length =
      std::isinf(norm_.p) ? 1.4142135623730951L : 1;  // rounded up
  Real rho = 0;
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Real correction = corrections_[i] / lambda_[i];
    const Real change =
        correction * compliances_[i].delta_lambda / certificate_.lower_bound;
    if (!(change < 0.5L)) {
      *refusal = "its multipliers do not balance at a point or a frame";
      return std::nullopt;
    }
    const Real length = DualNorm(y_[i], norm_) / lambda_[i];
    const Real longer = correction * compliances_[i].y * per_length;
    rho = std::max(rho, (length + longer) / (1 - change));
  }
  return static_cast<double>(rho) * (1 + 4 * kUnitRoundoff);
}

std::vector<MultiplierChange> ForceChecker::Changes() const {
  std::vector<MultiplierChange> changes;
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Real unit = certificate_.observations[i].lambda / lambda_[i];
    const Real correction = corrections_[i];
    changes.push_back(
        {static_cast<double>(correction * unit * compliances_[i].y),
         static_cast<double>(correction * compliances_[i].delta_lambda /
                             (lambda_[i] * certificate_.lower_bound))});
  }
  return changes;
}

}  // namespace krot::internal
