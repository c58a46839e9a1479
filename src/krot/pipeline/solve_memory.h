#pragma once

#include <cstdint>

#include "krot/bridge/bridge.h"
#include "krot/model/model.h"
#include "krot/pipeline/solve_model.h"

namespace krot {

// The largest resident set, in bytes, of a process that holds `model` and runs
// SolveModel on it.
struct SolveMemory {
  // As long as the joint solver gets by with few points beside those that are
  // large at the start; to 30 % on what was measured (docs/method.md).
  int64_t likely = 0;
  // If it takes in every observation, as an interior point on its way to a
  // start always does: an upper bound.
  int64_t at_most = 0;
};

// For summary.method, summary.init and summary.norm. O(problem).
SolveMemory EstimateSolveMemory(const Model& model, const BuiltProblem& built,
                                const SolveSummary& summary);

}  // namespace krot
