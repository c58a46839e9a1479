#pragma once

#include <memory>

#include "tools/benchmark/known_rotation_solver.h"

namespace krot::internal {

// Least squares over all translations and points, rotations fixed, by Ceres at
// its default tolerances: what bundle adjustment does with what is free here.
std::unique_ptr<KnownRotationSolver> MakeLeastSquares(int num_threads);

// Proximal splitting (proximal_splitting.h) of the whole problem. Its least
// squares step is one iteration of Ceres.
std::unique_ptr<KnownRotationSolver> MakeFullProximalSplitting(int num_threads);

// Gugat's method (gugat.h) on the whole problem: a sparse second-order cone
// programme per step. One thread.
std::unique_ptr<KnownRotationSolver> MakeFullGugat();

}  // namespace krot::internal
