#pragma once

#include <vector>

#include "krot/minimax/residual_set.h"

namespace krot {

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

}  // namespace krot
