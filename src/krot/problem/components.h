#pragma once

#include <cstdint>
#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Connected components of the graph of frames and points that the
// observations span. Each may be moved on its own without changing the cost.
struct Components {
  int32_t count = 0;
  std::vector<int32_t> of_frame;  // -1: the frame has no observation
  std::vector<int32_t> of_point;  // -1: the point has no observation
};

// Components are numbered by their first frame. Requires IndexObservations.
// O(observations) up to the inverse Ackermann function.
Components FindComponents(const KnownRotationProblem& problem);

}  // namespace krot
