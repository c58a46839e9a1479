#pragma once

#include <cstdint>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// The largest resident set, in bytes, of a process that holds `model` and runs
// SolveModel on it with summary.method and summary.init, if the joint solver
// gets by with the observations that it looks at first: within a quarter of the
// truth then (docs/method/joint_solver.md, "Memory"). O(problem).
int64_t EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                            const SolveSummary& summary,
                            const Context& context = {});

}  // namespace krot::internal
