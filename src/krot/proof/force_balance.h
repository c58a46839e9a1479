#pragma once

#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// A factor that covers the roundings of sums of non-negative bounds, in long
// double, and their cast to double.
inline constexpr long double kOutward = 1 + 1e-9L;

// The identity (1) of certificate_check.h says that forces balance. With unit
// vectors of the world, an observation pulls its point and its frame alike by
// f_i = R_cw' E_i'(y_i; delta lambda_i), and (1) is sum f_i = 0 at every point
// and at every frame that moves; what is fixed takes any force. E_i, R_cw are
// invertible: any change of f_i is one of the observation's multipliers.

// How far the forces at each point and frame are from balance, at most: the
// lengths of their sums.
struct Imbalance {
  std::vector<long double> of_point;
  std::vector<long double> of_frame;
};

// Per observation, how much its force has to change, at most, for all to
// balance: the imbalances are sent along the forest of observations that
// maximises the smallest `strength` on every way, towards what is fixed or, in
// a connected component without, the strongest. No others change. Exact but for
// roundings, for which the results are large enough. All strengths must be
// positive. O(observations log observations).
std::vector<long double> BoundCorrections(
    const KnownRotationProblem& problem,
    const std::vector<long double>& strength, const Imbalance& imbalance);

}  // namespace krot
