#pragma once

#include <vector>

#include "krot/minimax/residual_set.h"

namespace krot {

// The normalised negative gradients of the active residuals, G of
// [Zhang18, (6)]: all r_i(x) >= (1 - active_tolerance) max_i r_i(x), (5) with
// a relative tolerance. For p = 1 and infinity every active piece of an active
// residual contributes one. Residuals without gradient (r = 0) contribute
// none. Requires that residuals.Evaluate(x, norm) came last. O(N).
void FindDescentNormals(const ResidualSet& residuals, const Eigen::Vector3d& x,
                        Norm norm, double active_tolerance,
                        std::vector<Eigen::Vector3d>* descent_normals);

}  // namespace krot
