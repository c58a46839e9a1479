#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Connected components of the graph of frames and points that observations
// span. Each may be moved on its own without changing the cost.
struct Components {
  int32_t count = 0;
  std::vector<int32_t> of_frame;  // -1: the frame has no observation
  std::vector<int32_t> of_point;  // -1: the point has no observation
};

// Components are numbered by their first frame, and those of the whole where
// ranks share the points. O(observations) up to the inverse Ackermann function.
Components FindComponents(const KnownRotationProblem& problem,
                          const Context& context = {});

// The indices of all observations, by connected component: ascending, and
// components in the order of their first frame.
std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem);

// The same of some of them (ascending), by component of the graph that these
// alone span. O(observations given + points + frames).
std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem, std::vector<int64_t> observations);

}  // namespace krot
