#pragma once

#include <vector>

#include "krot/conic/cones.h"
#include "krot/conic/nt_scaling.h"
#include "krot/conic/observation_loop.h"
#include "krot/conic/point_elimination.h"
#include "krot/minimax/norm.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The excess programme (excess_program.h) and its Newton system at an iterate.
// Every observation has two pairs: s_i = T (b w_i + sigma_i; v_i) with z_i in
// the cone, and sigma_i with zeta_i, positive. A direction minimises
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
// rows for PointElimination; an observation whose sigma is large hardly counts
// along b.
template <typename Cone>
class ExcessSystem {
 public:
  static constexpr int kDim = Cone::kDim;
  using Vector = typename Cone::Vector;

  // A pair of values, primal and dual, of an observation: (s, z) in the cone
  // and (sigma, zeta).
  struct Iterate {
    Estimate x;
    std::vector<ViewedPoint> viewed;
    std::vector<double> sigma, zeta;
    std::vector<Vector> z;
  };

  // What a direction aims at: lambda o f and sqrt(sigma zeta) g are its
  // products.
  struct Target {
    Vector f = Vector::Zero();
    double g = 0;
  };

  // Where it leads, scaled by W and d.
  struct Direction {
    BlockVector dx;
    std::vector<Vector> ds, dz;
    std::vector<double> dsigma, dzeta;
  };

  // `costs` are the c_i, and `depths` those that are 1 in the gauge; or that is
  // about the centres of `start`, if there is one.
  ExcessSystem(const KnownRotationProblem& problem, Norm norm, double bound,
               std::vector<double> costs, const std::vector<double>& depths,
               double min_depth, const Estimate* start, int num_threads);

  // e'x, but for what the frame that stays put adds.
  double Size(const Estimate& x) const;

  Vector Slack(const ViewedPoint& viewed, double sigma) const {
    return T_ * Eigen::Vector3d(bound_ * (viewed.depth - min_depth_) + sigma,
                                viewed.v[0], viewed.v[1]);
  }
  // q'z.
  double Multiplier(const Vector& z) const { return T_.col(0).dot(z); }
  // `shortfall`: what e'x is to grow by, where the scale is free. False if
  // there is no factor.
  bool Factorize(const Iterate& at, double shortfall);
  // `target(i)` may depend on the last direction; `sigma` is the centring.
  template <typename MakeTarget>
  void Solve(const MakeTarget& target, double sigma) {
    loop_.ForEach([&](int64_t i) { target_[i] = target(i); });
    SolveForTarget(sigma);
  }

  const ObservationLoop& loop() const { return loop_; }
  double mu() const { return mu_; }  // of each pair
  const Vector& lambda(int64_t i) const { return scaled_[i].lambda; }
  double linear_lambda(int64_t i) const { return scaled_[i].linear_lambda; }
  const Direction& direction() const { return direction_; }
  // Without its scaling.
  Vector UnscaledDz(int64_t i) const {
    return scaled_[i].W.ApplyInverse(direction_.dz[i]);
  }
  double UnscaledDsigma(int64_t i) const {
    return direction_.dsigma[i] / scaled_[i].d;
  }
  double UnscaledDzeta(int64_t i) const {
    return direction_.dzeta[i] * scaled_[i].d;
  }

 private:
  struct Scaled {
    NtScaling<Cone> W;
    Vector lambda = Vector::Zero();
    double linear_lambda = 0;
    Vector b = Vector::Zero();
    double d = 0;
    double beta = 0;
    double kappa = 0;
  };

  void GaugeDepths(const std::vector<double>& depths);
  bool GaugeCentres(const Estimate& start);
  Vector ScaledChange(const BlockVector& dx, int64_t i) const;
  void AddSaturatedForces(BlockVector* forces) const;
  void SolveForTarget(double sigma);

  const KnownRotationProblem& problem_;
  const ObservationLoop loop_;
  const bool has_free_scale_;
  const double bound_;
  const double min_depth_;
  const std::vector<double> costs_;
  const BlockStructure structure_;
  const Eigen::Matrix<double, kDim, 3> T_;
  PointElimination<kDim> elimination_;
  double mu_ = 0;
  double shortfall_ = 0;
  std::vector<Scaled> scaled_;
  std::vector<Target> target_;
  std::vector<Vector> pulled_;  // S f
  BlockVector gauge_;           // e
  BlockVector x_gauge_;         // H^-1 e
  BlockVector x_target_;
  Direction direction_;
};

}  // namespace krot
