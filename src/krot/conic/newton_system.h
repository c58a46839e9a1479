#pragma once

#include <utility>
#include <vector>

#include "krot/conic/cone_program.h"
#include "krot/conic/cones.h"
#include "krot/conic/nt_scaling.h"
#include "krot/conic/observation_loop.h"
#include "krot/conic/point_elimination.h"
#include "krot/minimax/norm.h"

namespace krot {

// The Newton system of the interior point at an iterate. With s_i = T (top_i;
// v_i) in the cone, z_i its multiplier and W_i their scaling, a direction
// (dx, dg) minimises
//
//   1/2 sum_i | W_i^-1 ds_i - f_i |^2 + dg,   ds_i = (A dx + b dg)_i,
//
// a linear least squares problem, along the gauge e'dx = 0. The multipliers
// follow: W dz = f - lambda - W^-1 ds. All that is kept per observation is
// scaled by W, and so are A and b here. With H = A'A of PointElimination, g and
// the gauge are a border of two rows and columns:
//
//   [ H     A'b    e    ] [ dx ]   [ A'f     ]
//   [ b'A   b'b    0    ] [ dg ] = [ b'f - 1 ]
//   [ e'    0    -1/mu  ] [ nu ]   [ -sigma  ]
//
// where baselines set the scale: depths are only kept from growing without
// bound, less and less. Where the scale is free, 0 stands for -1/mu and for
// sigma. In the feasibility programme there is no e. In the linear programme b
// is 0, and the right-hand side of dx is A'f - h.
//
// For the cost programme, top = g w is bilinear. Its second-order term is left
// out, so that the system is that of a Dinkelbach step based at the iterate,
// and convex.
//
// Factorize at an iterate; then Solve for one f after another, each of which
// may be made of lambda() and the last target() and direction(). Restore puts
// an earlier direction back, but not its target.
template <typename Cone>
class NewtonSystem {
 public:
  static constexpr int kDim = Cone::kDim;
  using Vector = typename Cone::Vector;

  NewtonSystem(const KnownRotationProblem& problem, const ConeProgram& program,
               Norm norm, int num_threads);

  // s = T (top; v).
  Vector Slack(const ViewedPoint& viewed, double scalar) const;
  // (lambda; y) = T'z: the multipliers of the depth and of v.
  Eigen::Vector3d ToMultiplier(const Vector& z) const {
    return T_.transpose() * z;
  }

  // Scales and factorises at an iterate; false if there is no factor.
  bool Factorize(const std::vector<ViewedPoint>& viewed, double scalar,
                 const std::vector<Vector>& z);

  // The direction for the targets f = target(i), which may depend on the last
  // f and direction, and for the centring sigma of the depths' growth where
  // baselines set the scale.
  template <typename Target>
  void Solve(const Target& target, double sigma) {
    loop_.ForEach([&](int64_t i) { target_[i] = target(i); });
    SolveForTarget(sigma);
  }

  // Linear programme: the least change of z, in the scaling, after which the
  // forces balance, A'z = h but for a multiple of e; as the direction's dz.
  void SolveForBalance(const std::vector<Vector>& z);

  const ObservationLoop& loop() const { return loop_; }
  double gap() const { return gap_; }  // sum s'z = sum |lambda|^2
  double mu() const { return mu_; }    // of each pair, on the central path
  // Linear programme: how much h'x may change within the ellipsoid |A dx| <= 1
  // along the gauge.
  double ObjectiveLength() const;
  // Cost programme: depths below it are small beside the others.
  double small_depth() const { return small_depth_; }
  const std::vector<Vector>& lambda() const { return lambda_; }
  const std::vector<Vector>& target() const { return target_; }  // the last f

  // Where the last Solve leads; ds and dz are scaled.
  struct Direction {
    BlockVector dx;
    double dscalar = 0;
    std::vector<Vector> ds, dz;
  };
  const Direction& direction() const { return direction_; }
  void Restore(Direction direction) { direction_ = std::move(direction); }
  // The multipliers' direction without its scaling.
  Vector UnscaledDz(int64_t i) const {
    return scaling_[i].ApplyInverse(direction_.dz[i]);
  }

  static int64_t MemoryBytes(const KnownRotationProblem& problem);

 private:
  void FindGauge(const std::vector<ViewedPoint>& viewed);
  void SolveForTarget(double sigma);

  const KnownRotationProblem& problem_;
  const ConeProgram program_;
  const ObservationLoop loop_;
  const bool has_free_scale_;
  const BlockStructure structure_;
  const Eigen::Matrix<double, kDim, 3> T_;
  PointElimination<kDim> elimination_;
  double gap_ = 0;
  double mu_ = 0;
  double small_depth_ = 0;
  std::vector<NtScaling<Cone>> scaling_;
  std::vector<Vector> lambda_;
  std::vector<Vector> border_;  // b: the column of g
  std::vector<Vector> rest_;    // b - A Xb
  std::vector<Vector> target_;  // f
  BlockVector gauge_;           // e
  BlockVector x_border_;        // Xb = H^-1 A'b; linear programme: H^-1 h
  BlockVector x_gauge_;         // Xe = H^-1 e
  BlockVector x_target_;        // Xf = H^-1 A'f
  Direction direction_;
};

}  // namespace krot
