#pragma once

#include "krot/bridge/bridge.h"
#include "krot/problem/subset.h"

namespace krot::internal {

// The subset of built.problem as a built problem of its own, from `start`, an
// estimate of the whole; what was left out is not counted. O(subset).
BuiltProblem BuiltPart(const BuiltProblem& built, const ProblemSubset& subset,
                       const Estimate& start);

}  // namespace krot::internal
