#pragma once

#include <memory>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// The Newton-like descent of Dai et al. [2012; 6 of Zhang18]: instead of
// solving F(gamma) of parametric_program.h for one gamma after another, it
// takes one primal-dual Newton step for each, and gamma becomes the cost at its
// end. That point is on the boundary of the new feasible region; a relaxation t
// of all constraints makes it an interior point:
//
//   f_i(x) = (||v_i|| - gamma w_i) / w_i(x_k) <= t,
//   sum_i lambda_i grad f_i = 0,  sum_i lambda_i = 1,  lambda_i (t - f_i) = mu.
//
// The Hessian of every ||v_i|| is computed in every step. p = 2.
std::unique_ptr<SubproblemSolver> MakeDai();

}  // namespace krot::internal
