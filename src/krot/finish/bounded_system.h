#pragma once

#include <utility>
#include <vector>

#include "krot/conic/cones.h"
#include "krot/conic/nt_scaling.h"
#include "krot/conic/observation_loop.h"
#include "krot/conic/point_elimination.h"
#include "krot/finish/error_loss.h"
#include "krot/minimax/norm.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The Newton system of bounded least squares at an iterate. With s = T (cap w;
// v) in the cone, z its multiplier and W their scaling, as in newton_system.h,
// a direction dx minimises, summed over all observations,
//
//   1/2 rho' |e + J dx|^2 + 1/2 |W^-1 ds - f|^2 + degree mu dw / w,
//
//   ds = T (cap dw; dv),   J = (dv - e dw) / w,   degree that of the cone.
//
// The last term makes up for w in the barrier of the cone: together they are
// the barrier of e alone, which knows neither the scale of a component nor the
// length of a ray. So neither needs a gauge, and f = mu / lambda gives Newton's
// direction for 1/2 sum rho + mu sum Barrier.
//
// An observation's five rows (six with half lines) act on its x_cam alone: they
// are reduced to three, R, before the points are eliminated.
//
//   [ W^-1 T diag(cap, 1, 1)    ]
//   [ sqrt(rho') / w  (-e | I2) ] E  =  Q R E
template <typename Cone>
class BoundedSystem {
 public:
  using Vector = typename Cone::Vector;

  // Keeps a reference to `problem`, but for its observations' rows.
  BoundedSystem(const KnownRotationProblem& problem, Norm norm, double cap,
                const ErrorLoss& loss, int num_threads);

  // s = T (cap w; v); inside the cone where the residual is below the cap.
  Vector Slack(const ViewedPoint& viewed) const {
    return T_ * Eigen::Vector3d(cap_ * viewed.depth, viewed.v[0], viewed.v[1]);
  }
  // Of the error alone, at mu = 1: for p = 2 -1/2 log(1 - |e|^2 / cap^2), else
  // the same sum over the four half lines; 0 for e = 0.
  double Barrier(const ViewedPoint& viewed) const;

  // Scales and factorises at an iterate, whose rows are those of
  // `observations`, which must outlive the calls of Solve; false if there is no
  // factor.
  bool Factorize(const std::vector<Observation>& observations,
                 const std::vector<ViewedPoint>& viewed,
                 const std::vector<Vector>& z);

  // The direction for the targets f = target(i), which may depend on the last
  // direction, and for mu.
  template <typename Target>
  void Solve(const Target& target, double mu) {
    loop_.ForEach([&](int64_t i) { target_[i] = target(i); });
    SolveForTarget(mu);
  }

  const ObservationLoop& loop() const { return loop_; }
  double mu() const { return mu_; }  // mean of the pairs
  const std::vector<Vector>& lambda() const { return lambda_; }
  const std::vector<Vector>& target() const { return target_; }  // the last f

  // Where the last Solve leads; ds and dz are scaled.
  struct Direction {
    BlockVector dx;
    std::vector<Vector> ds, dz;
  };
  const Direction& direction() const { return direction_; }
  void Restore(Direction direction) { direction_ = std::move(direction); }
  // The multipliers' direction without its scaling.
  Vector UnscaledDz(int64_t i) const {
    return scaling_[i].ApplyInverse(direction_.dz[i]);
  }
  // What a full step along dx gains of the quadratic model, twice: the slope of
  // the barrier problem along it, squared pixels.
  double Slope() const { return slope_; }

  static int64_t MemoryBytes(const KnownRotationProblem& problem);

 private:
  void FindGradient(double mu);
  void SolveForTarget(double mu);

  const KnownRotationProblem& problem_;
  const double cap_;
  const ErrorLoss loss_;
  const ObservationLoop loop_;
  const BlockStructure structure_;
  const Eigen::Matrix<double, Cone::kDim, 3> T_;
  PointElimination<3> elimination_;
  const std::vector<Observation>* observations_ = nullptr;
  const std::vector<ViewedPoint>* viewed_ = nullptr;
  double mu_ = 0;
  double slope_ = 0;
  std::vector<NtScaling<Cone>> scaling_;
  std::vector<Vector> lambda_;
  std::vector<Vector> target_;
  std::vector<Eigen::Vector3d> pull_;  // of each observation on its x_cam
  BlockVector gradient_;               // of all
  Direction direction_;
};

}  // namespace krot
