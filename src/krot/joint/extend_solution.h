#pragma once

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Lowers the largest residual of every point that is above `level`, pixels, as
// the frames stand, to its optimum; points behind a camera stay. Whether there
// are none of those. O(observations).
bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate);

// Extends the solution of a working set, whose cost is `level`, to all other
// observations, so that no residual exceeds `highest` >= level, pixels. Points
// stay where they are if that is good enough, and otherwise take their own
// optimum as the frames stand. If that does not suffice, sweeps move the frames
// as well, and the set's points with them: its solution is seldom the only one,
// and what leaves a point above it is often a frame that the set hardly holds.
//
// Whether it succeeded; `estimate` is as far as it came either way. Points
// behind a camera stay there, and it fails. O(observations) per sweep.
bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate);

}  // namespace krot
