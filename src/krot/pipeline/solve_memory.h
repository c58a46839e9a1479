#pragma once

#include <cstdint>

#include "krot/model/model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The largest resident set, in bytes, of a process that holds `model` and runs
// SolveModel on it, as `summary.method` does. To 30 % where it matters
// (a gigabyte), an upper bound elsewhere. O(problem).
int64_t EstimateSolveBytes(const Model& model,
                           const KnownRotationProblem& problem,
                           SolveMethod method, Norm norm);

}  // namespace krot
