#pragma once

#include <functional>

#include "krot/bridge/reprojection.h"
#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// From the solution of the linear rows to one of the true residuals: how far to
// go along the way.

// The best estimate found on the segment from `from` (of finite true cost, its
// rows' point) to `to`, by true cost; on it the rows' cost is quasi-convex. Returns `from` where
// nothing is below it. `*step` in [0, 1], `*true_cost` in pixels.
Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, int num_threads,
                       double* step, double* true_cost);

}  // namespace krot
