#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/math/simplex_qp.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {

// The normalised negative gradients of the active residuals, G of
// [Zhang18, (6)]: all r_i(x) >= (1 - active_tolerance) max_i r_i(x), (5) with
// a relative tolerance. For p = 1 and infinity every active piece of an active
// residual contributes one. Residuals without gradient (r = 0) contribute
// none. Requires that residuals.Evaluate(x, norm) came last. O(N).
void FindDescentNormals(const ResidualSet& residuals, const Eigen::Vector3d& x,
                        Norm norm, double active_tolerance,
                        std::vector<Eigen::Vector3d>* descent_normals);

// The unit vector along the centre of the minimum enclosing ball of the
// descent normals [Zhang18, Alg. 3]; none if the centre is within
// `stationarity_tolerance` (eps_0) of the origin or there are no normals. Up
// to four normals by the closed form, more by their point of least norm,
// which is the same; `scratch` keeps its memory between calls.
std::optional<Eigen::Vector3d> FindDescentDirection(
    const std::vector<Eigen::Vector3d>& descent_normals,
    double stationarity_tolerance, std::vector<LinearPiece>* scratch);

// A residual along a line:  r(alpha) = ||u alpha + v||_p / (w alpha + z)
// [Zhang18, (28)].
struct LineResidual {
  Eigen::Vector2d u;
  Eigen::Vector2d v;
  double w = 0;
  double z = 0;
};

struct StepSizeOptions {
  double step_tolerance = 1e-6;  // eps_1 > 0, units of x
  double slope_probe = 1e-8;     // eps_2 > 0, units of x
  double max_step = 10;          // > 0, units of x
};

// The step alpha >= 0 along the unit vector `direction` that minimises the
// largest residual, by modified bisection [Zhang18, Alg. 4]. `scratch` keeps
// its memory between calls. About 3 log2(max_step / step_tolerance)
// evaluations of all residuals.
double FindStepSize(const ResidualSet& residuals, const Eigen::Vector3d& x,
                    const Eigen::Vector3d& direction, Norm norm,
                    const StepSizeOptions& options,
                    std::vector<LineResidual>* scratch);

}  // namespace krot::internal
