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
#include "krot/solver/verified_solution.h"

// How (1) is proved. Let M = [A_i' lambda_i]_i, without the rows of one frame
// per connected component: with R_f the frames' rotations, sum_f R_f' (rows of
// t_f) = sum_k (rows of s_k) for A and c alike, as a translation moves nothing,
// so these rows vanish once all others do. Let g be what the other rows of (1)
// miss. With M a = -g (verified_solution.h), y_i + lambda_i a_i satisfies (1)
// exactly; divided by rho = max_i (|y_i|_dual / lambda_i + |a_i|_dual) it is
// dual feasible and proves delta / rho.

namespace krot {
namespace {

using Eigen::MatrixXd;
using Real = long double;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Matrix23 = Eigen::Matrix<Real, 2, 3>;
using Vector2 = Eigen::Matrix<Real, 2, 1>;
using Vector3 = Eigen::Matrix<Real, 3, 1>;

constexpr double kUnitRoundoff = std::numeric_limits<double>::epsilon() / 2;
constexpr Real kRealRoundoff = std::numeric_limits<Real>::epsilon();
constexpr int64_t kMaxUnknowns = 6000;
// Covers a few roundings of non-negative bounds, and their cast to double.
constexpr double kOutward = 1 + 1e-9;
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
  void NumberUnknowns();
  UncertainSystem Assemble() const;
  // Of sums over the support, relative to the sum of absolute values: every
  // term goes through at most 12 roundings, and each sum adds one.
  Real SumError() const {
    return (static_cast<Real>(lambda_.size()) + 12) * kRealRoundoff;
  }
  std::optional<std::string> CheckConstants() const;
  void BoundRho();

  // Calls visit(first row, R, error of R) for the two unknowns of observation
  // i.
  template <typename Visit>
  void ForUnknowns(int64_t i, const Visit& visit) const;

  const KnownRotationProblem& whole_;
  const Norm norm_;
  const Certificate& certificate_;

  RestrictedProblem part_;
  std::vector<Real> lambda_;  // of part_, scaled to a maximum in [1/2, 1)
  std::vector<Vector2> y_;

  // The row of an unknown in (1); -1 for frames whose rows are omitted.
  std::vector<int64_t> row_of_frame_;
  int64_t num_rows_ = 0;
  Eigen::VectorXd a_bound_;  // bounds |a|
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
  NumberUnknowns();
  if (num_rows_ > kMaxUnknowns) return "its support is too large to be checked";
  if (num_rows_ > 2 * static_cast<int64_t>(lambda_.size())) {
    return "its support is flexible: it has more unknowns than equations";
  }
  return std::nullopt;
}

void Checker::NumberUnknowns() {
  const Components components = FindComponents(part_.problem);
  num_rows_ = 3 * int64_t{part_.problem.num_points};
  row_of_frame_.assign(part_.problem.num_frames, -1);
  int32_t num_seen = 0;  // components are numbered by their first frame
  for (int32_t f = 0; f < part_.problem.num_frames; ++f) {
    if (components.of_frame[f] == num_seen) {
      ++num_seen;
      continue;
    }
    row_of_frame_[f] = num_rows_;
    num_rows_ += 3;
  }
}

template <typename Visit>
void Checker::ForUnknowns(int64_t i, const Visit& visit) const {
  const Observation& observation = part_.problem.observations[i];
  const View& view = part_.problem.views[observation.view];
  visit(3 * int64_t{observation.point},
        Matrix3(view.cam_from_world_rotation.cast<Real>()), kRotationError);
  const int64_t row = row_of_frame_[view.frame];
  if (row >= 0) {
    visit(row, Matrix3(view.cam_from_rig_rotation.cast<Real>()), 0.0);
  }
}

// M, |g| and what their entries may be wrong by. A point's rotation R_sr R_rw
// counts as known to kRotationError, a frame's R_sr as exact: then the two are
// those of some R_rw, as the argument about the omitted rows needs.
UncertainSystem Checker::Assemble() const {
  const int64_t count = static_cast<int64_t>(lambda_.size());
  const Real delta = certificate_.lower_bound;
  UncertainSystem system;
  system.M = MatrixXd::Zero(num_rows_, 2 * count);
  system.M_error = MatrixXd::Zero(num_rows_, 2 * count);
  using Column = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  Column g = Column::Zero(num_rows_);
  Column g_error = Column::Zero(num_rows_);
  Column g_terms = Column::Zero(num_rows_);  // sum of absolute values
  for (int64_t i = 0; i < count; ++i) {
    const Matrix23 E = NumeratorRows(part_.problem.observations[i]);
    const Matrix23 E_terms = NumeratorTerms(part_.problem.observations[i]);
    ForUnknowns(i, [&](int64_t row, const Matrix3& R, double rotation_error) {
      const Matrix23 A = E * R;
      const Matrix23 A_terms = E_terms * R.cwiseAbs();
      const Vector2 A_error = rotation_error * E_terms.rowwise().sum();
      const Vector3 c = R.row(2).transpose();
      g.segment<3>(row) += A.transpose() * y_[i] + delta * lambda_[i] * c;
      g_terms.segment<3>(row) += A_terms.transpose() * y_[i].cwiseAbs() +
                                 delta * lambda_[i] * c.cwiseAbs();
      g_error.segment<3>(row).array() +=
          A_error.dot(y_[i].cwiseAbs()) + delta * lambda_[i] * rotation_error;
      system.M.block<3, 2>(row, 2 * i) =
          (lambda_[i] * A.transpose()).cast<double>();
      system.M_error.block<3, 2>(row, 2 * i) =
          (lambda_[i] * A_terms.transpose() *
               (2 * kUnitRoundoff + 12 * kRealRoundoff) +
           lambda_[i] * Vector3::Ones() * A_error.transpose())
              .cast<double>();
    });
  }
  system.g_bound =
      ((g.cwiseAbs() + g_error + SumError() * g_terms) * Real{kOutward})
          .cast<double>();
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
    const Vector2 a = a_bound_.segment<2>(2 * i).cast<Real>();
    const Real delta = certificate_.lower_bound;
    kappa += y_[i].dot(b) + delta * lambda_[i] * o[2];
    kappa_error += y_[i].cwiseAbs().dot(b_error) +
                   delta * lambda_[i] * 2 * o_error +
                   SumError() * (y_[i].cwiseAbs().dot(E_terms * o.cwiseAbs()) +
                                 delta * lambda_[i] * std::abs(o[2])) +
                   lambda_[i] * a.dot(b.cwiseAbs() + b_error);
  }
  if (kappa + kappa_error * Real{kOutward} <= 0) return std::nullopt;
  return "the constants of its rig rows do not keep their sign";
}

void Checker::BoundRho() {
  for (size_t i = 0; i < lambda_.size(); ++i) {
    const Vector2 a =
        a_bound_.segment<2>(2 * static_cast<int64_t>(i)).cast<Real>();
    const Real rho = DualNorm(y_[i], norm_) / lambda_[i] + DualNorm(a, norm_);
    rho_ = std::max(rho_, static_cast<double>(rho) * (1 + 4 * kUnitRoundoff));
  }
}

std::optional<std::string> Checker::Run() {
  if (auto refusal = RefuseNumbers(whole_, norm_, certificate_)) return refusal;
  if (auto refusal = Restrict()) return refusal;
  const std::optional<Eigen::VectorXd> a_bound = BoundSolution(Assemble());
  if (!a_bound) {
    return "its support is flexible, or too nearly so for this arithmetic";
  }
  a_bound_ = *a_bound;
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
