#pragma once

#include <optional>

#include "krot/camera/error_map.h"

namespace krot::internal {

// Branch and bound over the box |q|_inf <= reach of an ErrorMap, in the norm
// p = 1, 2 or infinity: what remainder_bound.h is proved with.

// Whether |f| > 1 is proved on all of the box's boundary.
bool BoundaryIsOutside(const ErrorMap& map, double p, double reach);

// An upper bound of max |m| over the points of the box with |f| <= 1, near it:
// at most 10 % of (max |m| - 1), or 1e-6, too large unless the budget of cells
// ends, or any that is at most `sufficient`. nullopt if det f' > 0 cannot be
// proved at all these points.
std::optional<double> LargestLinearError(const ErrorMap& map, double p,
                                         double reach, double sufficient);

// An upper bound of max -y'm over the points of the box with |f| <= 1, near it:
// at most 1e-7 too large unless the budget of cells ends, or any that is at
// most `sufficient`. Requires a dual norm of y of 1. nullopt as above.
std::optional<double> LargestAlong(const ErrorMap& map, double p, double reach,
                                   const Eigen::Vector2d& y, double sufficient);

}  // namespace krot::internal
