#pragma once

#include <memory>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// Proximal splitting [Eriksson, Isaksson 2014; 11 of Zhang18], with copies z_i
// of the residual vectors and multipliers u_i of the constraints r_i = z_i:
//
//   x <- one step of least squares on  sum_i ||r_i(x) - z_i + u_i||^2,
//   z <- proximal operator of the largest norm at r(x) + u,
//   u <- u + r(x) - z,
//
// while the penalty rho grows. The step is one of Gauss-Newton with Levenberg's
// damping, by Ceres' TinySolver. p = 2.
std::unique_ptr<SubproblemSolver> MakeProximalSplitting();

}  // namespace krot::internal
