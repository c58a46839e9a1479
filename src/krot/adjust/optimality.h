#pragma once

#include <optional>
#include <vector>

#include <ceres/problem.h>

namespace krot {

// Half the sum of the squared errors without any loss, and the squared errors
// themselves in the order in which their residuals were added (two residuals
// each). None where the problem cannot be evaluated.
struct SquaredErrors {
  double cost = 0;
  std::vector<double> values;  // pixels^2
};
std::optional<SquaredErrors> EvaluateErrors(int num_threads,
                                            ceres::Problem* problem);

// g' D^-1 g / (2 cost), loss included: g is the gradient of the cost by what
// may move and D the diagonal of J'J, so that g_j^2 / (2 D_j) is what moving
// unknown j alone gains, to first order. 0 at a stationary point and where the
// cost is 0. Invariant to the units of the unknowns. Memory: one Jacobian.
std::optional<double> Stationarity(int num_threads, ceres::Problem* problem);

}  // namespace krot
