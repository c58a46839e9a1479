#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"
#include "krot/verify/force_checker.h"

namespace krot::internal {

// A proof that estimates whose residuals are all at most `bound` do not reach
// farther than so: of the positions x_n of the pulls p_n,
//
//   sum_n p_n'x_n <= extent   for every estimate of a cost <= bound.
//
// With z the stacked unknowns, w_i = c_i'z + d_i and v_i = A_i z + b_i, let
// |y_i|_dual <= lambda_i, and let g'z + const be what the pulls make of z. If
//
//   (1)  sum_i A_i'y_i + bound sum_i lambda_i c_i = -g,
//   (2)  sum_i y_i'b_i + bound sum_i lambda_i d_i = kappa,
//
// then 0 <= sum_i (y_i'v_i + bound lambda_i w_i) = kappa - g'z. Where anything
// is fixed, extents are finite; what is fixed takes any force
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
// with what it trusts: (1) holds exactly for multipliers beside the
// certificate's, none of which leaves |y_i|_dual <= lambda_i, and the extent
// covers every rounding. Refuses a support one of whose components holds
// nothing that is fixed, and pulls at what is fixed, where any force is taken,
// that of the pull as well. Never an exception. O(support log support).
ExtentCheck CheckExtent(const KnownRotationProblem& problem, Norm norm,
                        const ExtentCertificate& certificate);

// By how much the pull `keeper`, at a view or a point, has to be multiplied so
// that the certificate balances there in its direction: the multiplier of what
// keeps the scale.
double BalancingPull(const KnownRotationProblem& problem,
                     const ExtentCertificate& certificate, const Pull& keeper);

}  // namespace krot::internal
