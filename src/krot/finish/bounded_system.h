#pragma once

#include <vector>

#include "krot/conic/observation_loop.h"
#include "krot/finish/centre_elimination.h"
#include "krot/finish/error_cap.h"
#include "krot/finish/error_loss.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// An observation's error e = v / w, pixels, and its depth w.
struct ViewedError {
  Eigen::Vector2d e;
  double depth;
};

// The Newton system of bounded least squares at an iterate, in pixels. With
// slacks h_j(e), multipliers l_j and J = de/dx_cam = (E_v - e E_w) / w, a
// direction solves, to first order,
//
//   sum J'(rho' (e + de) + sum_j (l_j + dl_j) n_j(e + de)) = 0,   de = J dx,
//   (h_j + dh_j)(l_j + dl_j) = mu,   dh_j = -n_j'de.
//
// dl eliminated, an observation's rows are
//
//   [        U J         ]    U'U = (rho' + kBend sum_j l_j) I
//   [ sqrt(h'l) E_w / w  ]          + sum_j l_j / h_j n_j n_j'
//
// the last of which holds back points whose depths the errors hardly tell, as
// the barrier of the cone of (cap w; v) would; it vanishes with mu. The
// right-hand side, -(rho' e + sum_j mu / h_j n_j), is minus the gradient of the
// barrier problem: any l > 0 gives a descent direction.
//
// As rotations stay, dx_cam = R_sr R_rw (ds_k - dc_f) with c_f the centre of
// frame f: the unknowns of CentreElimination.
template <typename Cap>
class BoundedSystem {
 public:
  using Vector = typename Cap::Vector;

  // Keeps a reference to `problem`, whose rows Factorize reads. Observations of
  // views behind the first `num_views` are bounds alone.
  BoundedSystem(const KnownRotationProblem& problem, const Cap& cap,
                const ErrorLoss& loss, int32_t num_views,
                const Context& context);

  // The system at an iterate; errors and multipliers must outlive the calls
  // below. False if there is no factor.
  bool Factorize(const std::vector<ViewedError>& viewed,
                 const std::vector<Vector>& multipliers);

  // Newton's direction for the barrier problem of this mu.
  void Solve(double mu);
  // The same with the second order of the products and slacks along that
  // direction [Mehrotra 1992].
  void Correct(double mu);

  const BlockVector& dx() const { return dx_; }
  // Where the last direction leads the slacks and multipliers of observation i.
  struct PairStep {
    Vector h, dh, dl;
  };
  PairStep StepOf(int64_t i) const;
  // The longest step <= 1 along dx that keeps all errors below the cap where
  // rows stay, times `damping`, which is >= 1 / 2.
  double MaxStep(double damping) const;
  // The longest step <= 1 along all dl that keeps all multipliers positive.
  double MaxDualStep() const;
  // sum h'l after such steps, to second order.
  double GapAfter(double primal, double dual) const;
  // What a full step gains of the quadratic model, twice; squared pixels.
  double Slope() const;

  const ObservationLoop& loop() const { return loop_; }
  const Cap& cap() const { return cap_; }

  static int64_t MemoryBytes(const KnownRotationProblem& problem);

 private:
  // What an observation's rows are made of: U = [a b; 0 c] and sqrt(h'l).
  struct Root {
    double a, b, c, depth;
  };
  // Second order along Newton's direction: of h_j l_j, and of each h_j.
  struct Correction {
    Vector product;
    double slack;
  };
  // Along the last direction: the longest steps <= 2, and sum h'l, as a
  // polynomial in the two step lengths.
  struct Reach {
    double primal, dual;
    double gap, by_primal, by_dual, by_both;
  };

  // rho' of an observation's error.
  double WeightOf(int64_t i) const {
    return problem_.observations[i].view < num_views_
               ? loss_.Weight((*viewed_)[i].e.squaredNorm())
               : 0;
  }
  Root RootOf(int64_t i) const;
  Correction CorrectionOf(int64_t i) const {
    return is_corrected_ ? correction_[i] : Correction{Vector::Zero(), 0};
  }
  Eigen::Vector2d PullOf(int64_t i) const;
  double ReachOf(int64_t i) const;
  void SolveForTarget();
  Reach FollowDirection();

  const KnownRotationProblem& problem_;
  const Cap cap_;
  const ErrorLoss loss_;
  const int32_t num_views_;
  const ObservationLoop loop_;
  const BlockStructure structure_;
  // R_rw of the frames that an observation has.
  const std::vector<Eigen::Matrix3d> frame_rotations_;
  CentreElimination elimination_;
  const std::vector<ViewedError>* viewed_ = nullptr;
  const std::vector<Vector>* multipliers_ = nullptr;
  double mu_ = 0;
  bool is_corrected_ = false;
  std::vector<Root> root_;
  std::vector<Correction> correction_;
  // Of the rows: the right-hand side, then (de; dw / w).
  std::vector<Eigen::Vector3d> d_;
  BlockVector dx_;
  Reach reach_ = {};
};

}  // namespace krot
