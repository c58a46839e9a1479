#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/conic/interior_point.h"
#include "krot/conic/path_following.h"

namespace krot::internal {

// The programmes that the interior point solves: minimise a scalar g subject to
// (top_i, v_i) in the cone ||v|| <= top for every observation, where
//
//   cost:         top = g w              g is gamma, a bound on all residuals
//   feasibility:  top = b (w + u (g - 1))  g < 1 makes every residual < b
//   linear:       top = b w              g = h'x
//
// with w the depth and u a unit of depth. The cost programme is homogeneous in
// the unknowns where no baseline sets a scale. The feasibility programme can
// start where depths are not positive.
struct ConeProgram {
  enum class Kind { kCost, kFeasibility, kLinear };
  Kind kind = Kind::kCost;
  double bound = 0;       // b, pixels; not used by the cost programme
  double unit_depth = 1;  // u, scene units; 0 in the linear programme
  const LinearObjective* linear = nullptr;  // h and e of the linear programme

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
// a linear least squares problem with the gauge e'dx = 0. The multipliers
// follow from W dz = f - lambda - W^-1 ds. Everything stored per observation is
// scaled by W, and so are A and b from here on. x stands for points and for the
// frames' centres in the world. With H = A'A, g and the gauge are a border of
// two rows and columns:
//
//   [ H     A'b    e    ] [ dx ]   [ A'f     ]
//   [ b'A   b'b    0    ] [ dg ] = [ b'f - 1 ]
//   [ e'    0    -1/mu  ] [ nu ]   [ -sigma  ]
//
// where baselines set the scale: then e'x has the weight mu only, which keeps
// depths from growing without bound and vanishes in the end. Where the scale is
// free, -1/mu and sigma are replaced by 0. In the feasibility programme there
// is no e. In the linear programme b is 0, and the right-hand side of dx is
// A'f - h.
//
// For the cost programme, top = g w is bilinear. Its second-order term is left
// out, so that the system is that of a Dinkelbach step based at the iterate,
// and convex.
//
// Usage: call Factorize at an iterate, then Solve for one f after the other; an
// f may be computed from lambda() and from the last target() and direction().
// Restore sets direction() to an earlier one, but not target().
template <typename ConeType>
class NewtonSystem : public ConeSystem<ConeType, ConeType::kDim> {
  using Base = ConeSystem<ConeType, ConeType::kDim>;

 public:
  using typename Base::Cone, typename Base::Direction, typename Base::Vector,
      typename Base::Vector3d;
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
               Norm norm, int num_threads)
      : Base(problem, norm, num_threads),
        program_(program),
        has_free_scale_(program.IsCost() && IsScaleFree(problem)),
        scaling_(problem.observations.size()),
        border_(problem.observations.size()),
        rest_(problem.observations.size()) {}

  // s = T (top; v)
  Vector Slack(const State& state, int64_t i) const {
    const ViewedPoint& viewed = state.viewed[i];
    return T_ * Vector3d(program_.Top(viewed.depth, state.scalar), viewed.v[0],
                         viewed.v[1]);
  }

  // (lambda; y) = T'z: the multipliers of the depth and of v.
  Eigen::Vector3d ToMultiplier(const Vector& z) const {
    return T_.transpose() * z;
  }
  // Stationarity of the cost programme depends on g, so primal and dual steps
  // must have the same length there.
  bool HasOneStep() const { return program_.IsCost(); }
  // Moves x and g along the direction; z is not changed.
  void Move(const State& from, double step, State* to) const {
    MoveCentres(rig_from_world_, from.x, step, direction_.dx, &to->x);
    to->scalar = from.scalar + step * direction_.dscalar;
    Base::ViewAll(to);
  }

  // Whether two iterates are near enough for the gauge and for the
  // linearisation of top = g w, which do not hold if a depth grows much. Only
  // small depths may grow by any factor.
  bool IsPlausible(const State& from, const State& to, int64_t i) const {
    if (!program_.IsCost()) return true;
    const double depth = to.viewed[i].depth;
    return to.scalar > 0 && depth > 0 &&
           depth <= 3 * std::max(from.viewed[i].depth, small_depth_);
  }

  // Scales and factorises at an iterate; false if there is no factor.
  bool Factorize(const State& at) {
    const double top_per_depth = program_.TopPerDepth(at.scalar);
    loop_.ForEach([&](int64_t i) {
      scaling_[i] = NtScaling<Cone>(Slack(at, i), at.z[i]);
      lambda_[i] = scaling_[i].Apply(at.z[i]);
      border_[i] = scaling_[i].ApplyInverse(
          T_.col(0) * program_.TopPerScalar(at.viewed[i].depth));
      Base::SetRows(i, top_per_depth, [&](const Vector& column) {
        return scaling_[i].ApplyInverse(column);
      });
    });
    Base::FindMu();
    if (!least_squares_.Factorize()) return false;

    // Solutions for the right-hand sides that are columns of the border.
    if (program_.IsLinear()) {
      least_squares_.SolveRefined(&program_.linear->h, nullptr, &x_border_,
                                  rest_[0].data());
    } else {
      least_squares_.SolveRefined(nullptr, border_[0].data(), &x_border_,
                                  rest_[0].data());
    }
    loop_.ForEach([&](int64_t i) { rest_[i] = border_[i] - rest_[i]; });
    FindGauge(at.viewed);
    least_squares_.SolveRefined(&gauge_, nullptr, &x_gauge_);
    return true;
  }

  // Finds the direction for the targets f = target(i), which may depend on the
  // last f and direction. `sigma` is the centring of the gauge's row, used
  // where baselines set the scale.
  template <typename Target>
  void Solve(const Target& target, double sigma) {
    loop_.ForEach([&](int64_t i) { target_[i] = target(i); });
    SolveForTarget(sigma);
  }

  // Linear programme: sets the direction's dz to the least change of z, in the
  // scaling, after which A'z = h but for a multiple of e:
  // dz = W^-2 A H^-1 (h - A'z + nu e). nu makes the vector in parentheses
  // orthogonal to e: it is small then, and the solution loses few digits.
  void SolveForStationarity(const std::vector<Vector>& z) {
    BlockVector missing = program_.linear->h;
    missing.Add(-1, GradientOf(problem_, structure_, [&](int64_t i) {
      Vector3d multiplier = ToMultiplier(z[i]);
      multiplier[0] *= program_.bound;
      return multiplier;
    }));
    if (program_.linear->e) {
      missing.Add(-gauge_.Dot(missing) / gauge_.Dot(gauge_), gauge_);
    }
    BlockVector x;
    least_squares_.SolveRefined(&missing, nullptr, &x, direction_.dz[0].data());
  }

  // Linear programme: the largest change of h'x within the ellipsoid
  // |A dx| <= 1 with e'dx = 0.
  double ObjectiveLength() const {
    double squared = program_.linear->h.Dot(x_border_);
    if (program_.linear->e) {
      const double along = gauge_.Dot(x_border_);
      squared -= along * along / gauge_.Dot(x_gauge_);
    }
    return std::sqrt(std::max(0.0, squared));
  }

  void Restore(Direction direction) { direction_ = std::move(direction); }
  // The multipliers' direction, with the scaling removed.
  Vector UnscaledDz(int64_t i) const {
    return scaling_[i].ApplyInverse(direction_.dz[i]);
  }

 private:
  using Base::direction_, Base::gauge_, Base::lambda_, Base::least_squares_,
      Base::loop_, Base::mu_, Base::problem_, Base::rig_from_world_,
      Base::structure_, Base::T_, Base::target_, Base::x_gauge_,
      Base::x_target_;

  // e = mean of c_i, in units of the median depth: e'dx is the change of the
  // mean depth. Apart from that unit e is the same in all iterations. Weights
  // that follow the iterate, as for relative changes of depths, would not hold
  // depths near each other: points would drift to infinity, or a part of the
  // scene would shrink to a point, and nothing would pull them back.
  void FindGauge(const std::vector<ViewedPoint>& viewed) {
    if (!program_.IsCost()) {
      gauge_.SetZero(problem_.num_points, problem_.num_frames);
      if (program_.IsLinear() && program_.linear->e)
        gauge_ = *program_.linear->e;
      return;
    }
    std::vector<double> depths;
    for (const ViewedPoint& v : viewed) depths.push_back(v.depth);
    const double median = Median(std::move(depths));
    small_depth_ = 0.1 * median;
    const double per_depth = 1 / (static_cast<double>(loop_.count()) * median);
    gauge_ = GradientOf(problem_, structure_, [&](int64_t) -> Vector3d {
      return {per_depth, 0, 0};
    });
  }

  // Finds the direction of x, g and the multipliers for the targets f. The
  // first row of the system is dx = Xf - Xb dg - Xe nu. Substituted into the
  // other two, it leaves
  //
  //   [ (b - A Xb)'b   -b'A Xe         ] [ dg ]   [ b'(f - A Xf) - 1 ]
  //   [ -e'Xb          -e'Xe  (- 1/mu) ] [ nu ] = [ -e'Xf  (- sigma) ]
  //
  // In the linear programme dg is set to 1 in this system, as Xb = H^-1 h.
  void SolveForTarget(double sigma) {
    least_squares_.SolveRefined(nullptr, target_[0].data(), &x_target_);
    Eigen::Matrix2d M;
    Eigen::Vector2d rhs;
    M(0, 0) = loop_.Sum([&](int64_t i) { return rest_[i].squaredNorm(); });
    // b'A X = (A'b)'X = (H Xb)'X, and (b - A Xb)'f = b'f - b'A Xf.
    M(0, 1) = -x_border_.Dot(gauge_);
    rhs[0] = loop_.Sum([&](int64_t i) { return rest_[i].dot(target_[i]); }) - 1;
    M(1, 0) = -gauge_.Dot(x_border_);
    M(1, 1) = -gauge_.Dot(x_gauge_);
    rhs[1] = -gauge_.Dot(x_target_);
    if (program_.IsLinear()) {
      M(0, 0) = rhs[0] = 1;
      M(0, 1) = 0;
    }
    if (program_.IsLinear() ? !program_.linear->e : !program_.IsCost()) {
      M(0, 1) = M(1, 0) = rhs[1] = 0;
      M(1, 1) = 1;
    } else if (program_.IsCost() && !has_free_scale_) {
      M(1, 1) -= 1 / mu_;
      rhs[1] -= sigma;
    }
    const Eigen::Vector2d solution = M.fullPivLu().solve(rhs);
    Direction& d = direction_;
    d.dscalar = solution[0];
    d.dx = x_target_;
    d.dx.Add(-d.dscalar, x_border_);
    d.dx.Add(-solution[1], x_gauge_);
    if (program_.IsLinear()) d.dscalar = program_.linear->h.Dot(d.dx);
    least_squares_.Multiply(d.dx, d.ds[0].data());
    loop_.ForEach([&](int64_t i) {
      d.ds[i] += d.dscalar * border_[i];
      d.dz[i] = target_[i] - lambda_[i] - d.ds[i];
    });
  }

  const ConeProgram program_;
  const bool has_free_scale_;
  double small_depth_ = 0;
  std::vector<NtScaling<Cone>> scaling_;
  std::vector<Vector> border_;  // b: the column of g
  std::vector<Vector> rest_;    // b - A Xb
  BlockVector x_border_;        // Xb = H^-1 A'b; linear programme: H^-1 h
};

}  // namespace krot::internal
