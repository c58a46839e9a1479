#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Of `others`, ascending, the longest tracks first, every point that sees a
// frame of which fewer than `count` observations are tied so far: `tied`, per
// frame, and those of the points before it. Where ranks share the points all
// call it, with the same `tied`, and each gets its own of those that one
// process takes. O(observations).
std::vector<int32_t> FindTies(const KnownRotationProblem& problem,
                              std::vector<int32_t> others, int count,
                              std::vector<int64_t> tied,
                              const Context& context);

}  // namespace krot::internal
