#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/math/simplex_qp.h"
#include "krot/minimax.h"
#include "krot/minimax/kernels.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {

// The residuals that bear a step, and their multipliers: a warm start for a
// problem much like theirs.
struct ActiveResiduals {
  int32_t size = 0;
  int32_t index[4] = {};
  float multiplier[4] = {};  // > 0, sum 1
};

// What max_i r_i looks like around a point x, from the residuals that matter
// there (the members): with f_k and g_k the value and gradient of every
// smooth piece of a member, a step d changes it to about
//
//   max_k (f_k + g_k'd) + 1/2 d'H d,    H = sum_i mu_i c_i b_i b_i' + kappa G.
//
// mu are the multipliers of the last step and c_i b_i b_i' the curvature of
// ||A_i x + b_i||_p / w_i: on the tangent space of the active residuals that
// is the Hessian of the Lagrangian, so that steps converge as Newton's method
// does. kappa G makes them short, in the metric
//
//   G = (1/n) sum_i (A_i'A_i + cost^2 c_i c_i') / (w_i^2 cost)
//
// of the members' own changes, which makes the method invariant to affine
// changes of x. With H = I, equal f_k and unit g_k, d is the MEB centre of
// [Zhang18, Alg. 3].
//
//   pieces: [ zero | member 0 | member 1 | ... | tangents of members      ]
//                    one each, or four           by trials that failed,
//                    for p = 1, infinity         until the next Linearize
//
// A descent calls Start, AddMember, Linearize and, for the first multipliers,
// StartFrom or Minimize and AdoptMultipliers; then, for every step, Minimize,
// AddMember for what a trial shows, and
//
//   if x moves:  AdoptMultipliers, Linearize
//   if not:      Linearize, if there are new members,
//                else RaiseMultipliers and AddTangents;
//
// and Active at the end.
class LocalModel {
 public:
  // What the minimiser of the model does.
  struct Step {
    Eigen::Vector3d d;
    double level;      // max_k (f_k + g_k'd)
    double held_back;  // d'Hd
  };

  // Forgets the members. The descent begins at `x_start`.
  void Start(const Eigen::Vector3d& x_start);

  // Adds residual number `index`; it counts from the next Linearize on.
  void AddMember(const ResidualSet& residuals, int index);

  // Rebuilds the pieces at x, where the maximum is `cost` > 0; all depths
  // must be positive. Keeps the multipliers.
  void Linearize(const Eigen::Vector3d& x, double cost, Norm norm);

  // The minimiser for kappa > 0. O(members).
  Step Minimize(double kappa);

  // Takes the multipliers of H from those of a problem much like this one; its
  // active residuals must be members.
  void StartFrom(const ActiveResiduals& active);

  // The members that bear the last step.
  ActiveResiduals Active();

  // Makes the multipliers of the last step those of H; `RaiseMultipliers`
  // only raises them, for another try from the same x, and returns whether
  // any has grown much.
  void AdoptMultipliers();
  bool RaiseMultipliers();

  // Adds, for every member above `level` at a trial that failed, the tangent
  // plane of its ||v||_p there: what curvature at x alone cannot tell (the
  // kinks of p < 2, the flats of p > 2, the far side of v = 0, the bend of a
  // residual of small multiplier). `trial_values` are by index. Returns
  // whether there were any.
  bool AddTangents(const Eigen::Vector3d& x_trial, const double* trial_values,
                   double level);

  // How much of the step d, at most 1, does what the model says: less where
  // depths of members fall, whose residuals go with 1 / depth.
  double ShareOf(const Eigen::Vector3d& d) const;

  // The largest depth at x of the members that bear the last step, by the
  // distance of the start from the camera of any member at most: as far as a
  // start beside one camera is from the others, depths may grow. A bound from
  // above where it is below a thousand.
  double DepthGrowth() const;

 private:
  struct Member {
    int index;
    double depth;            // at x
    double multiplier;       // mu_i
    double last_multiplier;  // of the last step
  };

  struct Bend {
    double curvature;           // c_i
    Eigen::Vector3d direction;  // b_i
  };

  void AddPieces();
  void AddSmoothPieces();
  bool IsMetricGood(double cost) const;
  void SetMetric(double cost);
  Bend BendOf(size_t m) const;
  Eigen::Matrix3d Hessian(double kappa) const;
  bool UpdateLastMultipliers();
  int FindMember(int index) const;

  std::vector<Member> members_;
  ResidualSet rows_;  // the members' residuals
  Norm norm_;
  Eigen::Vector3d x_start_;
  double depth_start_ = 0;  // the members' largest at x_start
  Eigen::Vector3d x_;
  std::vector<LinearPiece> pieces_;  // 0: no residual falls below zero
  std::vector<int> member_of_piece_;
  Eigen::Matrix3d metric_;            // G
  Eigen::Vector3d x_metric_;          // where G was set
  size_t num_members_of_metric_ = 0;  // then; 0: not yet
  std::vector<GradientBlock> gradients_;
  std::vector<LinearPiece> scaled_pieces_;
  SimplexQpSolution solution_;
};

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
// minimises a local model of the residuals near the maximum.
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
