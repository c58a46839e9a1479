#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"
#include "krot/verify/force_checker.h"

namespace krot::internal {

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

}  // namespace krot::internal
