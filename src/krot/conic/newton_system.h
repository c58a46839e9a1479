#pragma once

#include <utility>
#include <vector>

#include "krot/conic/cones.h"
#include "krot/conic/interior_point.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"
#include "krot/problem/centre_unknowns.h"
#include "krot/problem/cost.h"

namespace krot {

// The programmes that the interior point solves: minimise a scalar g subject to
// (top_i, v_i) in the cone ||v|| <= top for every observation, where
//
//   cost:         top = g w              g is gamma, a bound on all residuals
//   feasibility:  top = b (w + u (g - 1))  g < 1 makes every residual < b
//   linear:       top = b w              g = h'x
//
// with w the depth and u a unit of depth. The first is homogeneous in the
// unknowns where no baseline sets a scale; the second needs no positive depth
// to start.
struct ConeProgram {
  enum class Kind { kCost, kFeasibility, kLinear };
  Kind kind = Kind::kCost;
  double bound = 0;       // b, pixels; not of the cost programme
  double unit_depth = 1;  // u, scene units; 0 of the linear programme
  const LinearObjective* linear = nullptr;  // of the linear programme

  bool IsCost() const { return kind == Kind::kCost; }
  bool IsLinear() const { return kind == Kind::kLinear; }
  double Top(double depth, double g) const {
    return IsCost() ? g * depth : bound * (depth + unit_depth * (g - 1));
  }
  double TopPerDepth(double g) const { return IsCost() ? g : bound; }
  double TopPerScalar(double depth) const {
    return IsCost() ? depth : bound * unit_depth;
  }
};

// The Newton system of the interior point at an iterate. With s_i = T (top_i;
// v_i) in the cone, z_i its multiplier and W_i their scaling, a direction
// (dx, dg) minimises
//
//   1/2 sum_i | W_i^-1 ds_i - f_i |^2 + dg,   ds_i = (A dx + b dg)_i,
//
// a linear least squares problem, along the gauge e'dx = 0. The multipliers
// follow: W dz = f - lambda - W^-1 ds. All that is kept per observation is
// scaled by W, and so are A and b here. x stands for points and for the frames'
// centres in the world. With H = A'A, g and the gauge are a border of two rows
// and columns:
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
template <typename ConeType>
class NewtonSystem {
 public:
  using Cone = ConeType;
  using Vector = typename Cone::Vector;
  static constexpr int kNumCorrectors = 2;
  static constexpr bool kGapAfterOwnSteps = false;

  struct State {
    Estimate x;
    double scalar = 0;  // g
    std::vector<ViewedPoint> viewed;
    std::vector<Vector> z;
    double gap = 0;  // sum s'z
  };

  NewtonSystem(const KnownRotationProblem& problem, const ConeProgram& program,
               Norm norm, int num_threads);

  // Sets viewed from x.
  void ViewAll(State* state) const;
  Vector Slack(const State& state, int64_t i) const;  // s = T (top; v)
  // (lambda; y) = T'z: the multipliers of the depth and of v.
  Eigen::Vector3d ToMultiplier(const Vector& z) const {
    return T_.transpose() * z;
  }
  // Stationarity of the cost programme holds for one g, and so primal and dual
  // steps are of one length there.
  bool HasOneStep() const { return program_.IsCost(); }
  // Along the direction; leaves z alone.
  void Move(const State& from, double step, State* to) const;
  // Whether the linearised top = g w may hold between two iterates.
  bool IsPlausible(const State& from, const State& to, int64_t i) const;

  // Scales and factorises at an iterate; false if there is no factor.
  bool Factorize(const State& at);

  // The direction for the targets f = target(i), which may depend on the last
  // f and direction, and for the centring sigma of the depths' growth where
  // baselines set the scale.
  template <typename Target>
  void Solve(const Target& target, double sigma) {
    loop_.ForEach([&](int64_t i) { target_[i] = target(i); });
    SolveForTarget(sigma);
  }

  // Linear programme: the least change of z, in the scaling, after which the
  // dual residual vanishes, A'z = h but for a multiple of e; as the direction's
  // dz.
  void SolveForStationarity(const std::vector<Vector>& z);

  const ObservationLoop& loop() const { return loop_; }
  double mu() const { return mu_; }  // of each pair, on the central path
  // Linear programme: how much h'x may change within the ellipsoid |A dx| <= 1
  // along the gauge.
  double ObjectiveLength() const;
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

 private:
  static constexpr int kDim = Cone::kDim;

  void FindGauge(const std::vector<ViewedPoint>& viewed);
  void SolveForTarget(double sigma);

  const KnownRotationProblem& problem_;
  const ConeProgram program_;
  const ObservationLoop loop_;
  const bool has_free_scale_;
  const BlockStructure structure_;
  const std::vector<Eigen::Matrix3d> rig_from_world_;
  const Eigen::Matrix<double, kDim, 3> T_;
  CentredLeastSquares<kDim> least_squares_;
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
