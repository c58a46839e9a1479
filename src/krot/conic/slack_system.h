#pragma once

#include <vector>

#include "krot/conic/cones.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"
#include "krot/math/norm.h"
#include "krot/problem/centre_unknowns.h"
#include "krot/problem/cost.h"

namespace krot {

// The slack programme (slack_program.h) and its Newton system at an iterate.
// Every observation has two pairs: T (b w_i + sigma_i; v_i) in the cone, and
// sigma_i in the half-line; s_i and z_i are both together. A direction
// minimises
//
//   1/2 sum_i |W_i^-1 ds_i - f_i|^2 + (d_i dsigma_i - g_i)^2 + c_i dsigma_i,
//   ds_i = A_i dx + q dsigma_i,   d_i^2 = zeta_i / sigma_i,   q = T e_1,
//
// along the gauge. With b = W^-1 q and beta = b'b + d^2, an observation's own
// unknown is dsigma = (b'(f - W^-1 A dx) + d g - c) / beta; without it, what is
// left of the rows W^-1 A is S W^-1 A with
//
//   S S = I - b b' / beta,   S = I - kappa b b',
//
// rows of CentredLeastSquares; an observation whose sigma is large hardly
// counts along b.
template <typename BoundCone>
class SlackSystem {
 public:
  using Cone = WithHalfLine<BoundCone>;
  using Vector = typename Cone::Vector;
  static constexpr int kNumCorrectors = 0;
  static constexpr bool kGapAfterOwnSteps = true;

  struct State {
    Estimate x;
    std::vector<ViewedPoint> viewed;
    std::vector<double> sigma;
    std::vector<Vector> z;  // (z; zeta)
    double gap = 0;         // sum s'z
  };

  // Where a direction leads; ds and dz are scaled by W and d.
  struct Direction {
    BlockVector dx;
    std::vector<double> dsigma;
    std::vector<Vector> ds, dz;
  };

  // `costs` are the c_i, and `depths` those that are 1 in the gauge; or that is
  // about the centres of `start`, if there is one.
  SlackSystem(const KnownRotationProblem& problem, Norm norm, double bound,
              std::vector<double> costs, const std::vector<double>& depths,
              double min_depth, const Estimate* start, int num_threads);

  // e'x, but for what the frame that stays put adds.
  double Size(const Estimate& x) const;

  // Sets viewed from x.
  void ViewAll(State* state) const;
  // T (b w + sigma; v) in the bound's cone.
  typename BoundCone::Vector BoundSlack(const ViewedPoint& viewed,
                                        double sigma) const {
    return T_ * Eigen::Vector3d(bound_ * (viewed.depth - min_depth_) + sigma,
                                viewed.v[0], viewed.v[1]);
  }
  Vector Slack(const State& state, int64_t i) const {
    return Cone::Join(BoundSlack(state.viewed[i], state.sigma[i]),
                      state.sigma[i]);
  }
  // q'z.
  double Multiplier(const typename BoundCone::Vector& z) const {
    return T_.col(0).dot(z);
  }
  bool HasOneStep() const { return false; }
  void Move(const State& from, double step, State* to) const;
  bool IsPlausible(const State&, const State&, int64_t) const { return true; }

  // `shortfall`: what e'x is to grow by, where the scale is free. False if
  // there is no factor.
  bool Factorize(const State& at, double shortfall);
  // `target(i)`, (f; g), may depend on the last direction; `sigma` is the
  // centring.
  template <typename MakeTarget>
  void Solve(const MakeTarget& target, double sigma) {
    loop_.ForEach([&](int64_t i) { target_[i] = target(i); });
    SolveForTarget(sigma);
  }

  const ObservationLoop& loop() const { return loop_; }
  double mu() const { return mu_; }  // of each pair
  const std::vector<Vector>& lambda() const { return lambda_; }
  const Direction& direction() const { return direction_; }
  // Without its scaling.
  Vector UnscaledDz(int64_t i) const {
    const Scaled& own = scaled_[i];
    const Vector& dz = direction_.dz[i];
    return Cone::Join(own.W.ApplyInverse(Cone::Head(dz)),
                      own.d * Cone::Last(dz));
  }

 private:
  static constexpr int kDim = BoundCone::kDim;
  using BoundVector = typename BoundCone::Vector;

  struct Scaled {
    NtScaling<BoundCone> W;
    BoundVector b = BoundVector::Zero();
    double d = 0;
    double beta = 0;
    double kappa = 0;
  };

  BlockVector CentresGauge(const Estimate& start) const;
  BoundVector ScaledChange(const BlockVector& dx, int64_t i) const;
  void SolveForTarget(double sigma);

  const KnownRotationProblem& problem_;
  const ObservationLoop loop_;
  const bool has_free_scale_;
  const double bound_;
  const double min_depth_;
  const std::vector<double> costs_;
  const BlockStructure structure_;
  const std::vector<Eigen::Matrix3d> rig_from_world_;
  const Eigen::Matrix<double, kDim, 3> T_;
  CentredLeastSquares<kDim> least_squares_;
  double mu_ = 0;
  double shortfall_ = 0;
  std::vector<Scaled> scaled_;
  std::vector<Vector> lambda_;
  std::vector<Vector> target_;
  std::vector<BoundVector> rest_;  // S f
  BlockVector gauge_;              // e
  BlockVector x_gauge_;            // H^-1 e
  BlockVector x_target_;
  Direction direction_;
};

}  // namespace krot
