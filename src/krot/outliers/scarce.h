#pragma once

#include <cstdint>
#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// What is scarce where open observations look for conflicts: no two may share
// an observation.

// How dispensable observations are, in [0, 1]: those that are not free not at
// all, those of a track that an open one has little else of less than others.
std::vector<float> Worths(const KnownRotationProblem& problem,
                          const std::vector<char>& is_free,
                          const std::vector<int64_t>& open);

// Takes those out of `open` whose view has not enough free observations for a
// conflict in two views of each, which needs two. Both keep their order.
std::vector<int64_t> TakeCrowded(const KnownRotationProblem& problem,
                                 const std::vector<char>& is_free,
                                 std::vector<int64_t>* open);

}  // namespace krot::internal
