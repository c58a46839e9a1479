#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/math/simplex_qp.h"
#include "krot/minimax/residual_set.h"

namespace krot {

enum class DescentTermination {
  kNotRun,
  kStationary,  // no direction lowers the maximum, up to the tolerance
  kZeroCost,    // all residuals vanish
  kFarAway,     // a depth reached its limit: the infimum lies at infinity
  kNoDecrease,  // the best step does not lower the cost: rounding
  kMaxIterations,
};

struct DescentSummary {
  DescentTermination termination = DescentTermination::kNotRun;
  double cost_initial = 0;
  double cost = 0;     // <= cost_initial
  int iterations = 0;  // steps tried
};

// Minimises max_i r_i(x) by sequential quadratic programming. With the pieces
// f_i of the residuals near the maximum, a step solves
//
//   min over d   max_i (f_i + grad f_i' d) + 1/2 d' H d,
//   H = sum_i mu_i curvature_i bend_i bend_i' + kappa I,
//
// mu the multipliers of the last step: the Hessian of the Lagrangian on the
// tangent space of the active residuals, so that steps converge as Newton's
// method does. With H = I, equal f_i and unit gradients, d is the MEB centre
// of [Zhang18, Alg. 3]; large kappa brings d back to it, so that a step which
// lowers the maximum exists wherever it is not minimal.
//
// Only a working set of residuals enters the steps; residuals that a step
// raises above its prediction join it. Every trial costs one pass over all.
class NewtonDescent {
 public:
  // See FastDescent::Minimize.
  DescentSummary Minimize(ResidualSet* residuals, Norm norm, int max_iterations,
                          Eigen::Vector3d* x);

 private:
  // A residual of the working set and the depth that it started with.
  struct Member {
    int residual;
    double multiplier;
    double last_multiplier;
    double start_depth;
  };

  void StartWorkingSet(const ResidualSet& residuals);
  bool AddViolators(const ResidualSet& residuals, double level);
  void Linearize(const ResidualSet& residuals, const Eigen::Vector3d& x,
                 Norm norm);
  // The step for regularisation kappa, relative to the natural curvature.
  Eigen::Vector3d SolveStep(double cost, double kappa, double* level);
  bool UpdateMultipliers(bool step_failed);
  double DepthLimit(const ResidualSet& residuals, const Eigen::Vector3d& x,
                    const Eigen::Vector3d& step) const;

  std::vector<Member> working_set_;
  std::vector<char> is_member_;
  std::vector<ResidualPiece> pieces_;
  std::vector<int> member_of_piece_;
  std::vector<LinearPiece> scaled_pieces_;
  SimplexQpSolution solution_;
  Eigen::Vector3d x_start_;
};

}  // namespace krot
