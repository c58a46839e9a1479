#pragma once

#include <memory>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// Bisection on the cost [Kahl, Hartley 2008; 20 of Zhang18]. With gamma in the
// middle of [lower, upper], one convex feasibility problem (is F(gamma) < 0?
// parametric_program.h) halves the interval. p = 2 or infinity.
std::unique_ptr<SubproblemSolver> MakeBisection(Norm norm);

}  // namespace krot::internal
