#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// An observation of the support: those with lambda > 0 alone set the maximum.
struct CertifiedObservation {
  int64_t observation = 0;  // index in KnownRotationProblem::observations
  double lambda = 0;        // multiplier of the depth, > 0
  Eigen::Vector2d y = Eigen::Vector2d::Zero();  // of v; |y|_dual <= lambda
};

// A proof that no estimate costs less than lower_bound (1 - defect).
//
// With z the stacked unknowns (all that is not fixed), w_i = c_i'z + d_i and
// v_i = A_i z + b_i, multipliers with |y_i|_dual <= lambda_i and
//
//   (1)  sum_i A_i'y_i + delta sum_i lambda_i c_i  = 0
//   (2)  sum_i y_i'b_i + delta sum_i lambda_i d_i <= 0
//
// give for every z of cost gamma and positive depths
//
//   0 <= sum_i (y_i'v_i + gamma lambda_i w_i)
//     <= (gamma - delta) sum_i lambda_i w_i,
//
// hence gamma >= delta. In doubles (1) holds to rounding only, which alone
// would prove nothing, as z is unbounded.
struct Certificate {
  double lower_bound = 0;  // delta, pixels
  double defect = 0;       // what rounding may take from it, relative
  std::vector<CertifiedObservation> observations;  // ascending
};

inline constexpr double kMaxDefect = 1e-6;

// How much one observation's multipliers have to change, at most, for (1) to
// hold exactly.
struct MultiplierChange {
  double y = 0;      // |change of y|
  double depth = 0;  // change of delta lambda, relative to it
};

struct CertificateCheck {
  bool is_accepted = false;
  double proved_bound = 0;  // pixels; 0 unless accepted
  double defect = 0;        // 1 - proved_bound / lower_bound, relative
  std::string refusal;      // one sentence; empty if accepted
  // Of the certificate's observations, if accepted.
  std::vector<MultiplierChange> changes;
};

// Judges a certificate from the problem alone. Accepted if and only if it is
// proved, by arithmetic that accounts for every rounding, that multipliers
// exist beside the certificate's that satisfy (1) and (2) exactly and prove
// lower_bound (1 - certificate.defect), certificate.defect <= kMaxDefect, and
// |y_i|_dual <= lambda_i (1 + 1e-12).
//
// What the problem fixes counts as known exactly: of z, c_i, d_i, A_i and b_i
// it is part of the constants. The rotations count as known to kRotationError
// per entry. Works for p = 1, 2 and infinity; anything else, and whatever else
// is wrong with the certificate, is a refusal and never an exception. O(support
// log support).
CertificateCheck CheckCertificate(const KnownRotationProblem& problem,
                                  Norm norm, const Certificate& certificate);

// Entries of a rotation matrix that is computed from a quaternion, or is the
// product of two such, are this near to the truth.
inline constexpr double kRotationError = 2e-15;

inline constexpr double kUnitRoundoff =
    std::numeric_limits<double>::epsilon() / 2;

// What CheckCertificate asks of its input before it proves anything. Each
// returns why the input is refused, one sentence without its full stop, or
// nothing.

// Finite numbers, a known norm, observations of the problem in ascending
// order, and |y|_dual <= lambda for each.
std::optional<std::string> RefuseNumbers(const KnownRotationProblem& problem,
                                         Norm norm,
                                         const Certificate& certificate);

// Every R_cw must be R_sr R_rw, to kRotationError per entry, for one R_rw per
// frame; and all must be rotations as far as the proof relies on it.
std::optional<std::string> RefuseRotations(const KnownRotationProblem& problem);

// "start" value "end", with all digits of the value.
std::string Sentence(const std::string& start, double value,
                     const std::string& end);

}  // namespace krot::internal
