#pragma once

#include <vector>

#include "krot/minimax.h"
#include "krot/minimax/descent_step.h"
#include "krot/minimax/newton_descent.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {

// Throws std::invalid_argument naming the first field out of range.
void CheckOptions(const FastDescentOptions& options);

// Solves problems (1), min over x in R^3 of max_i r_i(x), one after another
// [Zhang18, Alg. 2]. Owns their residuals and the scratch memory: refilling
// and solving do not allocate once warm. Not thread-safe: one per thread.
class FastDescent {
 public:
  // Throws std::invalid_argument for options or a p out of range.
  FastDescent(const FastDescentOptions& options, Norm norm);

  ResidualSet& residuals() { return residuals_; }

  // Lowers the cost from *x; never raises it. Where a depth at *x is not
  // positive nothing is done, and the cost is infinite.
  DescentSummary Minimize(Eigen::Vector3d* x);

  // As far as `goal` says; `*active` is a warm start, and that of the next
  // descent afterwards. Both are without effect on kPaper.
  DescentSummary Minimize(const DescentGoal& goal, ActiveResiduals* active,
                          Eigen::Vector3d* x);

 private:
  DescentSummary MinimizeAsInPaper(Eigen::Vector3d* x);

  FastDescentOptions options_;
  Norm norm_;
  ResidualSet residuals_;
  NewtonDescent newton_;
  std::vector<Eigen::Vector3d> descent_normals_;
  std::vector<LinearPiece> pieces_;
  std::vector<LineResidual> line_;
};

}  // namespace krot::internal
