#pragma once

#include <optional>

#include <ceres/problem.h>

namespace krot {

// g' D^-1 g / (2 cost), loss included: g is the gradient of the cost by what
// may move and D the diagonal of J'J, so that g_j^2 / (2 D_j) is what moving
// unknown j alone gains, to first order. 0 at a stationary point and where the
// cost is 0. Invariant to the units of the unknowns. Memory: one Jacobian.
std::optional<double> Stationarity(int num_threads, double cost,
                                   ceres::Problem* problem);

}  // namespace krot
