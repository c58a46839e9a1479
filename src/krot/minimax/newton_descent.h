#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/math/simplex_qp.h"
#include "krot/minimax.h"
#include "krot/minimax/kernels.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {

// The active residuals of a step and their multipliers, for a warm start of a
// similar problem.
struct ActiveResiduals {
  int32_t size = 0;
  int32_t index[4] = {};
  float multiplier[4] = {};  // > 0, sum 1
};

// A local model of max_i r_i around a point x, made of the residuals that
// matter there (the members). With f_k and g_k the value and gradient of every
// smooth piece of a member, the model of the maximum after a step d is
//
//   max_k (f_k + g_k'd) + 1/2 d'H d,    H = sum_i mu_i c_i b_i b_i' + kappa G.
//
// mu are the multipliers of the last step and c_i b_i b_i' the curvature of
// ||A_i x + b_i||_p / w_i. On the tangent space of the active residuals their
// sum is the Hessian of the Lagrangian, so that steps converge as Newton's
// method does. kappa G shortens steps, in the metric
//
//   G = (1/n) sum_i (A_i'A_i + cost^2 c_i c_i') / (w_i^2 cost)
//
// which measures how v and w of the members change. So the method is invariant
// to affine changes of x. With H = I, equal f_k and unit g_k, d is the MEB
// centre of [Zhang18, Alg. 3].
//
//   pieces: [ zero | member 0 | member 1 | ... | tangents of members      ]
//                    one each, or four           from failed trials,
//                    for p = 1, infinity         until the next Linearize
//
// A descent calls Start, AddMember, Linearize and, for the first multipliers,
// StartFrom or else Minimize and AdoptMultipliers. Then, for every step, it
// calls Minimize, AddMember for residuals that a trial shows to matter, and
//
//   if x moves:  AdoptMultipliers, Linearize
//   if not:      Linearize, if there are new members,
//                else RaiseMultipliers and AddTangents.
//
// At the end it calls Active.
class LocalModel {
 public:
  // The minimiser of the model.
  struct Step {
    Eigen::Vector3d d;
    double level;      // max_k (f_k + g_k'd)
    double held_back;  // d'Hd
  };

  // Removes all members, for a new descent that begins at `x_start`.
  void Start(const Eigen::Vector3d& x_start);

  // Adds residual number `index`; it has an effect from the next Linearize on.
  void AddMember(const ResidualSet& residuals, int index);

  // Rebuilds the pieces at x, where the maximum is `cost` > 0; all depths
  // must be positive. Keeps the multipliers.
  void Linearize(const Eigen::Vector3d& x, double cost, Norm norm);

  // The minimiser for kappa > 0. O(members).
  Step Minimize(double kappa);

  // Sets the multipliers of H to those of a similar problem; its active
  // residuals must be members.
  void StartFrom(const ActiveResiduals& active);

  // The members that are active in the last step.
  ActiveResiduals Active();

  // Sets the multipliers of H to those of the last step. RaiseMultipliers only
  // raises them, for another try from the same x, and returns whether any has
  // grown much.
  void AdoptMultipliers();
  bool RaiseMultipliers();

  // For every member above `level` at a failed trial, adds the tangent plane of
  // its ||v||_p there. That shows what the curvature at x does not (kinks for
  // p < 2, flat parts for p > 2, the far side of v = 0, the bend of a residual
  // with a small multiplier). `trial_values` are indexed by residual. Returns
  // whether any were added.
  bool AddTangents(const Eigen::Vector3d& x_trial, const double* trial_values,
                   double level);

  // The share of the step d, at most 1, to which the model applies: below 1 if
  // depths of members fall, as residuals are proportional to 1 / depth.
  double ShareOf(const Eigen::Vector3d& d) const;

  // How much depths have grown since the start: the largest depth at x of the
  // members that are active in the last step, over the largest distance of the
  // start from the camera of a member. (The largest, because depths grow a lot
  // if the start is beside one camera and far from the others.) A result up to
  // a thousand is only an upper bound.
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
  double depth_start_ = 0;  // largest depth of a member at x_start
  Eigen::Vector3d x_;
  std::vector<LinearPiece> pieces_;  // the first is the zero piece
  std::vector<int> member_of_piece_;
  Eigen::Matrix3d metric_;            // G
  Eigen::Vector3d x_metric_;          // where G was set
  size_t num_members_of_metric_ = 0;  // when G was set; 0 if it was not
  std::vector<GradientBlock> gradients_;
  std::vector<LinearPiece> scaled_pieces_;
  SimplexQpSolution solution_;
};

// How far a descent goes. The default is as far as rounding allows.
struct DescentGoal {
  // It ends with a step whose promised decrease, or the decrease that it is
  // estimated to leave, is below this; relative, >= 1e-11.
  double tolerance = kFinestTolerance;
  // It does nothing if the cost is at most this; pixels, >= 0.
  double level = 0;
  // It ends once the cost is at most this; pixels, >= 0.
  double sufficient = 0;
};

// Minimises max_i r_i(x) by sequential quadratic programming: every step
// minimises a local model of the residuals near the maximum. If a trial keeps
// too little of the decrease that the model promised, the model is improved by
// residuals that it lacked, multipliers and tangents. If that does not help, a
// larger kappa shortens the step; a short enough one lowers the maximum unless
// that is minimal. Every trial takes one pass over all residuals.
//
//   step of the model:   promises nothing, perhaps only because of kappa?
//     |                    kappa falls to its smallest; again
//     v
//   trial, one pass:     leaves nothing to the next?  kStationary
//     |-- keeps enough of the promise:  x moves, kappa may fall; again
//     |-- or improves the model:        again
//     `-- neither:                      kappa rises; again
class NewtonDescent {
 public:
  // See FastDescent::Minimize.
  DescentSummary Minimize(ResidualSet* residuals, Norm norm, int max_iterations,
                          const DescentGoal& goal, ActiveResiduals* active,
                          Eigen::Vector3d* x);

 private:
  // Used by one descent at a time; kept for their memory.
  LocalModel model_;
  std::vector<char> is_member_;
};

}  // namespace krot::internal
