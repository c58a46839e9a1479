#include "krot/conic/newton_system.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/problem/fixed.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Depths below this share of the median depth are small: they count as much in
// the gauge, and may grow by any factor.
constexpr double kSmallDepth = 0.1;
// No other depth grows by more than this factor in a step: far beyond, neither
// the gauge nor the linearised top = g w holds.
constexpr double kMaxDepthGrowth = 3;

}  // namespace

template <typename Cone>
NewtonSystem<Cone>::NewtonSystem(const KnownRotationProblem& problem,
                                 const ConeProgram& program, Norm norm,
                                 int num_threads)
    : problem_(problem),
      program_(program),
      loop_(static_cast<int64_t>(problem.observations.size()), num_threads),
      has_free_scale_(program.IsCost() && IsScaleFree(problem)),
      structure_(AnchoredStructure(problem)),
      rig_from_world_(RigFromWorldRotations(problem)),
      T_(ConeMap<kDim>(norm)),
      least_squares_(structure_, {num_threads}),
      scaling_(problem.observations.size()),
      lambda_(problem.observations.size()),
      border_(problem.observations.size()),
      rest_(problem.observations.size()),
      target_(problem.observations.size()) {
  direction_.ds.resize(problem.observations.size());
  direction_.dz.resize(problem.observations.size());
}

template <typename Cone>
void NewtonSystem<Cone>::ViewAll(State* state) const {
  state->viewed.resize(problem_.observations.size());
  loop_.ForEach([&](int64_t i) {
    state->viewed[i] = ViewPoint(problem_, problem_.observations[i], state->x);
  });
}

template <typename Cone>
typename Cone::Vector NewtonSystem<Cone>::Slack(const State& state,
                                                int64_t i) const {
  const ViewedPoint& viewed = state.viewed[i];
  return T_ * Vector3d(program_.Top(viewed.depth, state.scalar), viewed.v[0],
                       viewed.v[1]);
}

template <typename Cone>
void NewtonSystem<Cone>::Move(const State& from, double step, State* to) const {
  MoveCentres(rig_from_world_, from.x, step, direction_.dx, &to->x);
  to->scalar = from.scalar + step * direction_.dscalar;
  ViewAll(to);
}

template <typename Cone>
bool NewtonSystem<Cone>::IsPlausible(const State& from, const State& to,
                                     int64_t i) const {
  if (!program_.IsCost()) return true;
  const double depth = to.viewed[i].depth;
  return to.scalar > 0 && depth > 0 &&
         depth <=
             kMaxDepthGrowth * std::max(from.viewed[i].depth, small_depth_);
}

template <typename Cone>
bool NewtonSystem<Cone>::Factorize(const State& at) {
  using Rows = Eigen::Matrix<double, kDim, 3, Eigen::RowMajor>;
  const double top_per_depth = program_.TopPerDepth(at.scalar);
  loop_.ForEach([&](int64_t i) {
    scaling_[i] = NtScaling<Cone>(Slack(at, i), at.z[i]);
    lambda_[i] = scaling_[i].Apply(at.z[i]);
    border_[i] = scaling_[i].ApplyInverse(
        T_.col(0) * program_.TopPerScalar(at.viewed[i].depth));
    const Observation& o = problem_.observations[i];
    Matrix3d E = o.E;
    E.row(0) *= top_per_depth;
    Rows rows;  // of x_cam
    for (int c = 0; c < 3; ++c) {
      rows.col(c) = scaling_[i].ApplyInverse(T_ * E.col(c));
    }
    Eigen::Map<Rows>(least_squares_.rows(i)).noalias() =
        rows * problem_.views[o.view].cam_from_world_rotation;
  });
  mu_ = loop_.Sum([&](int64_t i) { return lambda_[i].squaredNorm(); }) /
        static_cast<double>(loop_.count() * Cone::kDegree);
  if (!least_squares_.Factorize()) return false;

  // What the border needs of the factorised part.
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

// e = mean of c_i / w_i, w_i at least the small depth: e'dx is the mean
// relative change of the depths. Its multiplier is as large as the gap, so that
// with depths that fall like the gap alone the dual residual would not vanish.
template <typename Cone>
void NewtonSystem<Cone>::FindGauge(const std::vector<ViewedPoint>& viewed) {
  if (!program_.IsCost()) {
    gauge_.SetZero(problem_.num_points, problem_.num_frames);
    if (program_.IsLinear() && program_.linear->e) gauge_ = *program_.linear->e;
    return;
  }
  std::vector<double> depths;
  for (const ViewedPoint& v : viewed) depths.push_back(v.depth);
  small_depth_ = kSmallDepth * Median(std::move(depths));
  gauge_ = GradientOf(problem_, structure_, [&](int64_t i) -> Vector3d {
    const double depth = std::max(viewed[i].depth, small_depth_);
    return {1 / (static_cast<double>(loop_.count()) * depth), 0, 0};
  });
}

template <typename Cone>
double NewtonSystem<Cone>::ObjectiveLength() const {
  double squared = program_.linear->h.Dot(x_border_);
  if (program_.linear->e) {
    const double along = gauge_.Dot(x_border_);
    squared -= along * along / gauge_.Dot(x_gauge_);
  }
  return std::sqrt(std::max(0.0, squared));
}

// The direction for the targets f, and the multipliers'. The first row of the
// system is dx = Xf - Xb dg - Xe nu; put into the other two, it leaves
//
//   [ (b - A Xb)'b   -b'A Xe         ] [ dg ]   [ b'(f - A Xf) - 1 ]
//   [ -e'Xb          -e'Xe  (- 1/mu) ] [ nu ] = [ -e'Xf  (- sigma) ]
//
// In the linear programme 1 takes the place of dg there, as Xb = H^-1 h.
template <typename Cone>
void NewtonSystem<Cone>::SolveForTarget(double sigma) {
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

// dz = W^-2 A H^-1 (h - A'z + nu e), nu such that what is missing has no part
// in e: it is small then, and so is what the solution costs in digits.
template <typename Cone>
void NewtonSystem<Cone>::SolveForStationarity(const std::vector<Vector>& z) {
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

template class NewtonSystem<SecondOrderCone>;
template class NewtonSystem<FourHalfLines>;

}  // namespace krot
