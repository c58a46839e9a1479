#pragma once

#include <optional>
#include <vector>

#include <ceres/problem.h>

namespace krot {

// The residuals without any loss, in the order in which they were added, two
// per observation, pixels. None where one cannot be evaluated.
std::optional<std::vector<double>> EvaluateResiduals(int num_threads,
                                                     ceres::Problem* problem);

double HalfSquaredNorm(const std::vector<double>& residuals);

// g' D^-1 g / (2 cost), loss included: g is the gradient of the cost by what
// may move and D the diagonal of J'J, so that g_j^2 / (2 D_j) is what moving
// unknown j alone gains, to first order. 0 at a stationary point and where the
// cost is 0. Invariant to the units of the unknowns. Memory: one Jacobian.
std::optional<double> Stationarity(int num_threads, ceres::Problem* problem);

}  // namespace krot
