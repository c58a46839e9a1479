#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Connected components of the graph whose nodes are frames and points and whose
// edges are observations. Each may be moved on its own without changing the
// cost.
struct Components {
  int32_t count = 0;
  std::vector<int32_t> of_frame;  // -1: the frame has no observation
  std::vector<int32_t> of_point;  // -1: the point has no observation
};

// Components are numbered in the order of their first frames. Where ranks share
// the points, they are those of the whole problem. O(observations) up to the
// inverse Ackermann function.
Components FindComponents(const KnownRotationProblem& problem,
                          const Context& context = {});

// The indices of all observations by connected component: each list ascending,
// and the components in the order of their first frames.
std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem);

// The same for some observations (ascending), by components of the graph that
// has these edges only. O(observations given + points + frames).
std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem, std::vector<int64_t> observations);

}  // namespace krot::internal
