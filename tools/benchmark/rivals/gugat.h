#pragma once

#include <memory>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// The method that [Agarwal et al. 2008] found to be the fastest [Gugat 1996; 15
// of Zhang18]: Newton's method for the zero of F (parametric_program.h,
// weighted by the depths). The multipliers of its optimum give the slope,
//
//   F'(gamma) = -sum_i lambda_i w_i,   gamma <- gamma - F / F'.
//
// It keeps an interval: the cost of every minimiser is an upper bound, and
// every gamma with F(gamma) > 0 is a lower one. A step that leaves the interval
// is replaced by the upper bound. p = 2 or infinity.
std::unique_ptr<SubproblemSolver> MakeGugat(Norm norm);

}  // namespace krot::internal
