#pragma once

#include <cstdint>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/model/model.h"
#include "krot/pipeline/solve_model.h"

namespace krot {

// The largest resident set, in bytes, of a process that holds `model` and runs
// SolveModel on it. How near that comes is measured in
// docs/method/joint_solver.md, "Memory".
struct SolveMemory {
  // If the joint solver gets by with what it looks at first.
  int64_t likely = 0;
  // If it takes in every observation, as it does on its way to a start, and
  // repairs all multipliers at once.
  int64_t at_most = 0;
};

// For summary.method, summary.init and summary.norm. O(problem).
SolveMemory EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                                const SolveSummary& summary,
                                const Context& context = {});

}  // namespace krot
