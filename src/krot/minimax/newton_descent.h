#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/minimax.h"
#include "krot/minimax/descent_constants.h"
#include "krot/minimax/local_model.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {

// How far a descent goes. The default is as far as rounding allows.
struct DescentGoal {
  // It ends with the step that promises less than this or, so far as the step
  // itself can tell, leaves less than this to the next; relative, >= 1e-11.
  double tolerance = kFinestTolerance;
  // It does nothing where the cost is this low; pixels, >= 0.
  double level = 0;
  // It ends with the step that makes the cost this low; pixels, >= 0.
  double sufficient = 0;
};

// Minimises max_i r_i(x) by sequential quadratic programming: every step
// minimises a local model (local_model.h) of the residuals near the maximum.
// A step that keeps too little of what the model promised teaches the model:
// residuals that it overlooked, multipliers, tangents; where that does not
// help, kappa shortens the step, so that one which lowers the maximum exists
// wherever it is not minimal. Every trial costs one pass over all residuals.
//
//   step of the model:   promises nothing, though kappa alone may be why?
//     |                    kappa falls to its least; again
//     v
//   trial, one pass:     leaves nothing to the next?  kStationary
//     |-- keeps enough of the promise:  x moves, kappa may fall; again
//     |-- or teaches the model:         again
//     `-- neither:                      kappa rises; again
class NewtonDescent {
 public:
  // See FastDescent::Minimize.
  DescentSummary Minimize(ResidualSet* residuals, Norm norm, int max_iterations,
                          const DescentGoal& goal, ActiveResiduals* active,
                          Eigen::Vector3d* x);

 private:
  // Of a descent; kept for their memory.
  LocalModel model_;
  std::vector<char> is_member_;
};

}  // namespace krot::internal
