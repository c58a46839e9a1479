#pragma once

#include "krot/base/context.h"
#include "krot/bridge/reprojection.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// How far to go along the segment from `from` to `to`, the solution of the
// linear rows taken at `from`, in true errors and in how positions are kept: on
// all of it the rows' cost is at most that at `from` [quasi-convexity], so a
// short enough step lowers the true one wherever `from` is not stationary.

// The best estimate found, `from` if none is below it; `*step` in [0, 1].
// O(observations) per trial.
Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, const Context& context,
                       double* step);

// The same for every point on its own, where both have the same frames.
Estimate BestPointsOnSegments(const Reprojection& reprojection,
                              const KnownRotationProblem& problem,
                              const Estimate& from, const Estimate& to,
                              Norm norm, int num_threads);

}  // namespace krot::internal
