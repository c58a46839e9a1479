#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/geometry.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// An observation of the support: only those with lambda > 0 set the maximum.
struct CertifiedObservation {
  int64_t observation = 0;  // index in KnownRotationProblem::observations
  double lambda = 0;        // multiplier of the depth, > 0
  Eigen::Vector2d y = Eigen::Vector2d::Zero();  // of v; |y|_dual <= lambda
};

// A proof that no estimate costs less than lower_bound (1 - defect).
//
// With z the vector of all unknowns (of what is not fixed), w_i = c_i'z + d_i
// and v_i = A_i z + b_i, multipliers with |y_i|_dual <= lambda_i and
//
//   (1)  sum_i A_i'y_i + delta sum_i lambda_i c_i  = 0
//   (2)  sum_i y_i'b_i + delta sum_i lambda_i d_i <= 0
//
// give for every z of cost gamma and positive depths
//
//   0 <= sum_i (y_i'v_i + gamma lambda_i w_i)
//     <= (gamma - delta) sum_i lambda_i w_i,
//
// hence gamma >= delta. In doubles (1) holds up to rounding only. That by
// itself proves nothing, as z is unbounded; hence the defect.
struct Certificate {
  double lower_bound = 0;  // delta, pixels
  double defect = 0;       // loss of the bound by rounding, relative
  std::vector<CertifiedObservation> observations;  // ascending
};

inline constexpr double kMaxDefect = 1e-6;

// An upper bound on how much one observation's multipliers have to change so
// that (1) holds exactly.
struct MultiplierChange {
  double y = 0;      // |change of y|
  double depth = 0;  // change of delta lambda, relative to it
};

struct CertificateCheck {
  bool is_accepted = false;
  double proved_bound = 0;  // pixels; 0 unless accepted
  double defect = 0;        // 1 - proved_bound / lower_bound, relative
  std::string refusal;      // one sentence; empty if accepted
  // One per observation of the certificate, if accepted.
  std::vector<MultiplierChange> changes;
};

// Judges a certificate from the problem alone. It is accepted if and only if
// all of this holds: arithmetic that accounts for every rounding proves that
// multipliers near the certificate's exist which satisfy (1) and (2) exactly
// and prove lower_bound (1 - certificate.defect); certificate.defect <=
// kMaxDefect; and |y_i|_dual <= lambda_i (1 + 1e-12).
//
// Fixed positions count as known exactly; they are not in z but contribute to
// the constants b_i and d_i. Rotations count as known to kRotationError per
// entry. Works for p = 1, 2 and infinity. Any other norm, and anything that is
// wrong with the certificate, leads to a refusal, never to an exception.
// O(support log support).
CertificateCheck CheckCertificate(const KnownRotationProblem& problem,
                                  Norm norm, const Certificate& certificate);

// A linear objective p'x, where x is the centre of a view or a point, in world
// coordinates. With a pull, forces balance if they add up to p at the view's
// frame, or to -p at the point.
struct Pull {
  enum class Kind { kView, kPoint };
  Kind kind = Kind::kView;
  int32_t index = 0;  // of the view, or of the point
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  // p
};

// A proof of how far estimates whose residuals are all at most `bound` reach.
// With the positions x_n and the directions p_n of the pulls,
//
//   sum_n p_n'x_n <= extent   for every estimate of a cost <= bound.
//
// With z the vector of all unknowns, w_i = c_i'z + d_i and v_i = A_i z + b_i,
// let |y_i|_dual <= lambda_i, and let g'z + const = sum_n p_n'x_n. If
//
//   (1)  sum_i A_i'y_i + bound sum_i lambda_i c_i = -g,
//   (2)  sum_i y_i'b_i + bound sum_i lambda_i d_i = kappa,
//
// then 0 <= sum_i (y_i'v_i + bound lambda_i w_i) = kappa - g'z. Extents are
// finite only where something is fixed; at what is fixed, (1) asks for nothing
// (docs/method/outliers.md, "What the data allow").
struct ExtentCertificate {
  double bound = 0;  // pixels
  std::vector<Pull> pulls;
  std::vector<CertifiedObservation> observations;  // ascending
};

struct ExtentCheck {
  bool is_accepted = false;
  double extent = 0;    // scene units
  std::string refusal;  // one sentence; empty if accepted
};

// Judges a certificate from the problem alone, as CheckCertificate does, and
// under the same assumptions. If it is accepted, (1) holds exactly for
// multipliers near the certificate's with |y_i|_dual <= lambda_i, and the
// extent allows for every rounding. Refuses a support with a component in which
// nothing is fixed, and pulls at fixed positions, which would have no effect in
// (1). Never throws. O(support log support).
ExtentCheck CheckExtent(const KnownRotationProblem& problem, Norm norm,
                        const ExtentCertificate& certificate);

// The factor by which the pull `keeper`, at a view or a point, has to be
// multiplied so that (1) holds there in the direction of `keeper`. It is the
// multiplier of the constraint that holds the scale.
double BalancingPull(const KnownRotationProblem& problem,
                     const ExtentCertificate& certificate, const Pull& keeper);

// The largest error of an entry of a rotation matrix that is computed from a
// quaternion or is the product of two such matrices.
inline constexpr double kRotationError = 2e-15;

inline constexpr double kUnitRoundoff =
    std::numeric_limits<double>::epsilon() / 2;

// Checks of the input before anything is proved. Each returns the reason of a
// refusal, one sentence without its full stop, or nothing.

// Requires finite numbers, a known norm, observations of the problem in
// ascending order, and |y|_dual <= lambda for each.
std::optional<std::string> RefuseNumbers(const KnownRotationProblem& problem,
                                         Norm norm,
                                         const Certificate& certificate);

// Requires every R_cw to be R_sr R_rw, to kRotationError per entry, with the
// same R_rw for all views of a frame; and all must be rotations as far as the
// proof relies on it.
std::optional<std::string> RefuseRotations(const KnownRotationProblem& problem);

// "start" value "end", with all digits of the value.
std::string Sentence(const std::string& start, double value,
                     const std::string& end);

}  // namespace krot::internal
