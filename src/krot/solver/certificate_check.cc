#include "krot/solver/certificate_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>

#include <Eigen/LU>

#include "krot/problem/components.h"
#include "krot/problem/restrict.h"
#include "krot/solver/certificate_input.h"
#include "krot/solver/verified_blocks.h"
#include "krot/solver/verified_dense.h"

// How (1) is proved. Let M = [A_i' lambda_i]_i, without the rows of one frame
// per connected component: with R_f the frames' rotations, sum_f R_f' (rows of
// t_f) = sum_k (rows of s_k) for A and c alike, as a translation moves nothing,
// so these rows vanish once all others do. Let g be what the other rows of (1)
// miss. With M a = -g (verified_solution.h), y_i + lambda_i a_i satisfies (1)
// exactly; divided by rho = max_i |y_i|_dual / lambda_i + max_i |a_i|_dual it
// is dual feasible and proves delta / rho.

namespace krot {
namespace {

using Real = long double;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Matrix23 = Eigen::Matrix<Real, 2, 3>;
using Vector2 = Eigen::Matrix<Real, 2, 1>;
using Vector3 = Eigen::Matrix<Real, 3, 1>;

constexpr double kUnitRoundoff = std::numeric_limits<double>::epsilon() / 2;
constexpr Real kRealRoundoff = std::numeric_limits<Real>::epsilon();
// Covers a few roundings of non-negative bounds, and their cast to double.
constexpr double kOutward = 1 + 1e-9;
constexpr double kRootTwo = 1.4142135623730952;  // above it
// Costs a bound next to nothing, nor (2) its sign.
constexpr double kShortLength = 1e-10;
// Smaller multipliers, relative, might underflow.
constexpr double kSmallestShare = 1e-100;

// E = J (I2 | -u): v = E x_cam.
Matrix23 NumeratorRows(const Observation& observation) {
  Matrix23 rows;
  rows << Matrix23::Identity().leftCols<2>(), -observation.u.cast<Real>();
  return observation.J.cast<Real>() * rows;
}

// What E sums up, before any cancellation: |J| (I2 | |u|).
Matrix23 NumeratorTerms(const Observation& observation) {
  Matrix23 rows;
  rows << Matrix23::Identity().leftCols<2>(),
      observation.u.cast<Real>().cwiseAbs();
  return observation.J.cast<Real>().cwiseAbs() * rows;
}

// Three rows of g, what they may be wrong by, and the sums of their terms'
// absolute values.
struct RowsOfG {
  Vector3 sum = Vector3::Zero();
  Vector3 error = Vector3::Zero();
  Vector3 terms = Vector3::Zero();
};

// A bound on every |a_i|_2. The quicker way first, and the sharper one where
// the first leaves anything to be desired.
std::optional<double> BoundLength(const UncertainSystem& system) {
  const std::optional<double> by_blocks = BoundSolutionByBlocks(system);
  if (by_blocks && *by_blocks <= kShortLength) return by_blocks;
  const std::optional<double> largest = BoundSolutionByInverse(system);
  if (!largest) return by_blocks;
  const double length = kRootTwo * *largest;
  return by_blocks ? std::min(*by_blocks, length) : length;
}

class Checker {
 public:
  Checker(const KnownRotationProblem& problem, Norm norm,
          const Certificate& certificate)
      : whole_(problem), norm_(norm), certificate_(certificate) {}

  // The first thing that is wrong, or none.
  std::optional<std::string> Run();

  double rho() const { return rho_; }

 private:
  std::optional<std::string> Restrict();
  void NumberFrames();
  UncertainSystem Assemble() const;
  // Of sums over the support, relative to the sum of absolute values: every
  // term goes through at most 12 roundings, and each sum adds one.
  Real SumError() const {
    return (static_cast<Real>(lambda_.size()) + 12) * kRealRoundoff;
  }
  std::optional<std::string> CheckConstants() const;
  void BoundRho();

  const KnownRotationProblem& whole_;
  const Norm norm_;
  const Certificate& certificate_;

  RestrictedProblem part_;
  std::vector<Real> lambda_;  // of part_, scaled to a maximum in [1/2, 1)
  std::vector<Vector2> y_;

  // The number of a frame among those whose rows are not omitted; -1: omitted.
  std::vector<int32_t> number_of_frame_;
  int32_t num_numbered_ = 0;
  double a_length_ = 0;  // bounds every |a_i|_2
  double rho_ = 0;
};

std::optional<std::string> Checker::Restrict() {
  std::vector<int64_t> observations;
  double largest = 0;
  for (const CertifiedObservation& o : certificate_.observations) {
    observations.push_back(o.observation);
    largest = std::max(largest, o.lambda);
  }
  part_ = RestrictProblem(whole_, observations);
  int exponent = 0;
  std::frexp(largest, &exponent);
  for (const CertifiedObservation& o : certificate_.observations) {
    if (o.lambda < kSmallestShare * largest) {
      return "its multipliers differ by more than 100 decades";
    }
    lambda_.push_back(std::ldexp(Real{o.lambda}, -exponent));
    y_.push_back({std::ldexp(Real{o.y[0]}, -exponent),
                  std::ldexp(Real{o.y[1]}, -exponent)});
  }
  if (auto refusal = RefuseRotations(part_.problem)) return refusal;
  NumberFrames();
  if (num_numbered_ > kMaxVerifiedFrames) {
    return "its support has too many frames to be checked";
  }
  if (3 * (int64_t{part_.problem.num_points} + num_numbered_) >
      2 * static_cast<int64_t>(lambda_.size())) {
    return "its support is flexible: it has more unknowns than equations";
  }
  return std::nullopt;
}

// Omits the first frame of every connected component.
void Checker::NumberFrames() {
  const Components components = FindComponents(part_.problem);
  number_of_frame_.assign(part_.problem.num_frames, -1);
  int32_t num_seen = 0;  // components are numbered by their first frame
  for (int32_t f = 0; f < part_.problem.num_frames; ++f) {
    if (components.of_frame[f] == num_seen) {
      ++num_seen;
    } else {
      number_of_frame_[f] = num_numbered_++;
    }
  }
}

// M, |g| and what their entries may be wrong by. A point's rotation R_sr R_rw
// counts as known to kRotationError, a frame's R_sr as exact: then the two are
// those of some R_rw, as the argument about the omitted rows needs.
UncertainSystem Checker::Assemble() const {
  const KnownRotationProblem& problem = part_.problem;
  const int64_t count = static_cast<int64_t>(lambda_.size());
  const Real delta = certificate_.lower_bound;
  UncertainSystem system;
  std::vector<RowsOfG> g_point(problem.num_points);
  std::vector<RowsOfG> g_frame(num_numbered_);
  for (int64_t i = 0; i < count; ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    const Matrix23 E = NumeratorRows(observation);
    const Matrix23 E_terms = NumeratorTerms(observation);
    UncertainSystem::Columns columns;
    const auto add = [&](const Eigen::Matrix3d& rotation, double rotation_error,
                         UncertainSystem::Block* rows,
                         UncertainSystem::BlockError* error, RowsOfG* g) {
      const Matrix3 R = rotation.cast<Real>();
      const Matrix23 A = E * R;
      const Matrix23 A_terms = E_terms * R.cwiseAbs();
      const Vector2 A_error = rotation_error * E_terms.rowwise().sum();
      const Vector3 c = R.row(2).transpose();
      g->sum += A.transpose() * y_[i] + delta * lambda_[i] * c;
      g->terms += A_terms.transpose() * y_[i].cwiseAbs() +
                  delta * lambda_[i] * c.cwiseAbs();
      g->error.array() +=
          A_error.dot(y_[i].cwiseAbs()) + delta * lambda_[i] * rotation_error;
      *rows = lambda_[i] * A.transpose();
      *error = (lambda_[i] * A_terms.transpose() * (12 * kRealRoundoff) +
                lambda_[i] * Vector3::Ones() * A_error.transpose())
                   .cast<double>();
    };
    columns.point = observation.point;
    add(view.cam_from_world_rotation, kRotationError, &columns.point_rows,
        &columns.point_error, &g_point[observation.point]);
    columns.frame = number_of_frame_[view.frame];
    if (columns.frame >= 0) {
      add(view.cam_from_rig_rotation, 0, &columns.frame_rows,
          &columns.frame_error, &g_frame[columns.frame]);
    }
    system.columns.push_back(columns);
  }
  const auto bound = [&](const RowsOfG& g) -> Eigen::Vector3d {
    return ((g.sum.cwiseAbs() + g.error + SumError() * g.terms) *
            Real{kOutward})
        .cast<double>();
  };
  for (const RowsOfG& g : g_point) system.point_bound.push_back(bound(g));
  for (const RowsOfG& g : g_frame) system.frame_bound.push_back(bound(g));
  return system;
}

// (2), once every frame's origin has moved to the projection centre of the
// first of its views that the support sees: t_f + R_sr^-1 t_sr of that view is
// the unknown as well as t_f is. If each frame has one centre, the constants
// are gone.
std::optional<std::string> Checker::CheckConstants() const {
  const KnownRotationProblem& problem = part_.problem;
  const int64_t count = static_cast<int64_t>(lambda_.size());
  std::vector<int32_t> first_view(problem.num_frames, -1);
  Real kappa = 0;
  Real kappa_error = 0;
  for (int64_t i = 0; i < count; ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    int32_t& first = first_view[view.frame];
    if (first < 0) first = observation.view;
    if (first == observation.view) continue;
    const Vector3 t = view.cam_from_rig_translation.cast<Real>();
    const Vector3 t_first =
        problem.views[first].cam_from_rig_translation.cast<Real>();
    const Vector3 o =
        t - view.cam_from_rig_rotation.cast<Real>() *
                Matrix3(problem.views[first].cam_from_rig_rotation.cast<Real>())
                    .inverse() *
                t_first;
    const Real o_error =
        8 * kRotationError * (t.cwiseAbs().sum() + t_first.cwiseAbs().sum());
    const Vector2 b = NumeratorRows(observation) * o;
    const Matrix23 E_terms = NumeratorTerms(observation);
    const Vector2 b_error = E_terms.rowwise().sum() * (2 * o_error);
    const Real delta = certificate_.lower_bound;
    kappa += y_[i].dot(b) + delta * lambda_[i] * o[2];
    kappa_error += y_[i].cwiseAbs().dot(b_error) +
                   delta * lambda_[i] * 2 * o_error +
                   SumError() * (y_[i].cwiseAbs().dot(E_terms * o.cwiseAbs()) +
                                 delta * lambda_[i] * std::abs(o[2])) +
                   lambda_[i] * a_length_ * (b.cwiseAbs() + b_error).sum();
  }
  if (kappa + kappa_error * Real{kOutward} <= 0) return std::nullopt;
  return "the constants of its rig rows do not keep their sign";
}

// Of all a_i of this length, the one along the diagonal has the longest dual
// norm: sqrt(2) of it.
void Checker::BoundRho() {
  const Real longest_a = norm_.p == 1 || norm_.p == 2
                             ? Real{a_length_}
                             : Real{kRootTwo * a_length_};
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Real rho = DualNorm(y_[i], norm_) / lambda_[i] + longest_a;
    rho_ = std::max(rho_, static_cast<double>(rho) * (1 + 4 * kUnitRoundoff));
  }
}

std::optional<std::string> Checker::Run() {
  if (auto refusal = RefuseNumbers(whole_, norm_, certificate_)) return refusal;
  if (auto refusal = Restrict()) return refusal;
  const std::optional<double> a_length = BoundLength(Assemble());
  if (!a_length) {
    return "its support is flexible, or too nearly so for this arithmetic";
  }
  a_length_ = *a_length;
  if (auto refusal = CheckConstants()) return refusal;
  BoundRho();
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
  Checker checker(problem, norm, certificate);
  CertificateCheck check;
  if (auto refusal = checker.Run()) {
    check.refusal = *refusal;
    check.defect = std::max(0.0, checker.rho() - 1);
    return check;
  }
  check.is_accepted = true;
  check.proved_bound =
      certificate.lower_bound / checker.rho() * (1 - 4 * kUnitRoundoff);
  check.defect = std::max(0.0, checker.rho() - 1);
  return check;
}

}  // namespace krot
