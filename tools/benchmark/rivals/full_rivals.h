#pragma once

#include <memory>

#include "tools/benchmark/known_rotation_solver.h"

namespace krot::internal {

// Least squares over all translations and points with rotations fixed, by Ceres
// with its default tolerances: bundle adjustment restricted to the unknowns of
// the known rotation problem.
std::unique_ptr<KnownRotationSolver> MakeLeastSquares(int num_threads);

// Proximal splitting (proximal_splitting.h) of the whole problem. Its least
// squares step is one iteration of Ceres.
std::unique_ptr<KnownRotationSolver> MakeFullProximalSplitting(int num_threads);

// Gugat's method (gugat.h) on the whole problem: a sparse second-order cone
// programme per step. One thread.
std::unique_ptr<KnownRotationSolver> MakeFullGugat();

}  // namespace krot::internal
