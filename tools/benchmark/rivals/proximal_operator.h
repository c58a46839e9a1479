#pragma once

#include <vector>

#include <Eigen/Core>

namespace krot::internal {

// The proximal operator of the largest norm, in place:
//
//   argmin over z   max_i ||z_i||_2 + rho/2 sum_i ||z_i - a_i||^2.
//
// Every a_i longer than t is shortened to t, where t satisfies
// sum_i max(0, ||a_i|| - t) = 1 / rho and is found by bisection [Eriksson,
// Isaksson 2014]. If the sum is smaller than that at t = 0, all become zero.
// rho > 0.
void ApplyMaxNormProx(double rho, std::vector<Eigen::Vector2d>* a);

}  // namespace krot::internal
