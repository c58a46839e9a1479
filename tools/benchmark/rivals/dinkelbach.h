#pragma once

#include <memory>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// Dinkelbach's method [Dinkelbach 1967; Olsson, Eriksson, Kahl 2007; 7 and 28
// of Zhang18]: F(gamma) of parametric_program.h is solved to optimality, and
// gamma becomes the cost of its minimiser, until that no longer falls. p = 2 or
// infinity.
std::unique_ptr<SubproblemSolver> MakeDinkelbach(Norm norm);

}  // namespace krot::internal
