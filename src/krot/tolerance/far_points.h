#pragma once

#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The points all of whose residuals are below `bound`, pixels, from infinitely
// far away: some direction is in the inside of all their cones. Wherever the
// frames stand, such a point fits in if it is far enough out; so it says
// nothing about where they stand. One mark per point. O(observations).
std::vector<char> FindFarPoints(const KnownRotationProblem& problem, Norm norm,
                                double bound, const Context& context);

}  // namespace krot
