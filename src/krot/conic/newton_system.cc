#include "krot/conic/newton_system.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "krot/problem/fixed.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Of the median depth; smaller ones count as this much.
constexpr double kSmallDepth = 0.1;

double MedianDepth(const std::vector<ViewedPoint>& viewed) {
  std::vector<double> depths;
  depths.reserve(viewed.size());
  for (const ViewedPoint& v : viewed) depths.push_back(v.depth);
  const auto middle =
      depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

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
      T_(ConeMap<kDim>(norm)),
      elimination_(structure_, num_threads),
      scaling_(problem.observations.size()),
      lambda_(problem.observations.size()),
      border_(problem.observations.size()),
      rest_(problem.observations.size()),
      target_(problem.observations.size()) {
  direction_.ds.resize(problem.observations.size());
  direction_.dz.resize(problem.observations.size());
}

template <typename Cone>
typename Cone::Vector NewtonSystem<Cone>::Slack(const ViewedPoint& viewed,
                                                double scalar) const {
  return T_ *
         Vector3d(program_.Top(viewed.depth, scalar), viewed.v[0], viewed.v[1]);
}

template <typename Cone>
bool NewtonSystem<Cone>::Factorize(const std::vector<ViewedPoint>& viewed,
                                   double scalar,
                                   const std::vector<Vector>& z) {
  using Rows = Eigen::Matrix<double, kDim, 3, Eigen::RowMajor>;
  const double top_per_depth = program_.TopPerDepth(scalar);
  loop_.ForEach([&](int64_t i) {
    scaling_[i] = NtScaling<Cone>(Slack(viewed[i], scalar), z[i]);
    lambda_[i] = scaling_[i].Apply(z[i]);
    border_[i] = scaling_[i].ApplyInverse(
        T_.col(0) * program_.TopPerScalar(viewed[i].depth));
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    Matrix3d E = o.E;
    E.row(0) *= top_per_depth;
    Rows rows;  // of x_cam
    for (int c = 0; c < 3; ++c) {
      rows.col(c) = scaling_[i].ApplyInverse(T_ * E.col(c));
    }
    Eigen::Map<Rows>(elimination_.point_rows(i)).noalias() =
        rows * view.cam_from_world_rotation;
    Eigen::Map<Rows>(elimination_.frame_rows(i)).noalias() =
        rows * view.cam_from_rig_rotation;
  });
  gap_ = loop_.Sum([&](int64_t i) { return lambda_[i].squaredNorm(); });
  mu_ = gap_ / static_cast<double>(loop_.count() * Cone::kDegree);
  if (!elimination_.Factorize()) return false;

  // What the border needs of the factorised part.
  BlockVector zero;
  zero.SetZero(problem_.num_points, problem_.num_frames);
  if (program_.IsLinear()) {
    elimination_.Solve(program_.linear->h, nullptr, &x_border_);
  } else {
    elimination_.Solve(zero, border_[0].data(), &x_border_);
  }
  FindGauge(viewed);
  elimination_.Solve(gauge_, nullptr, &x_gauge_);
  elimination_.Multiply(x_border_, rest_[0].data());
  loop_.ForEach([&](int64_t i) { rest_[i] = border_[i] - rest_[i]; });
  return true;
}

// e = mean of c_i / w_i, w_i at least the small depth: e'dx is the mean
// relative change of the depths. Its multiplier is as large as the gap, so that
// with depths that fall like the gap alone its forces would not vanish.
template <typename Cone>
void NewtonSystem<Cone>::FindGauge(const std::vector<ViewedPoint>& viewed) {
  gauge_.SetZero(problem_.num_points, problem_.num_frames);
  if (program_.IsLinear() && program_.linear->e) gauge_ = *program_.linear->e;
  if (!program_.IsCost()) return;
  small_depth_ = kSmallDepth * MedianDepth(viewed);
  for (int64_t i = 0; i < loop_.count(); ++i) {
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    const double weight = 1 / (static_cast<double>(loop_.count()) *
                               std::max(viewed[i].depth, small_depth_));
    const Vector3d c = weight * o.E.row(0).transpose();
    gauge_.points[o.point] += view.cam_from_world_rotation.transpose() * c;
    if (structure_.frame_is_fixed[view.frame]) continue;
    gauge_.frames[view.frame] += view.cam_from_rig_rotation.transpose() * c;
  }
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
  BlockVector zero;
  zero.SetZero(problem_.num_points, problem_.num_frames);
  elimination_.Solve(zero, target_[0].data(), &x_target_);
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
  elimination_.Multiply(d.dx, d.ds[0].data());
  loop_.ForEach([&](int64_t i) {
    d.ds[i] += d.dscalar * border_[i];
    d.dz[i] = target_[i] - lambda_[i] - d.ds[i];
  });
}

// dz = W^-2 A H^-1 (h - A'z + nu e), nu such that what is missing has no part
// in e: it is small then, and so is what the solution costs in digits.
template <typename Cone>
void NewtonSystem<Cone>::SolveForBalance(const std::vector<Vector>& z) {
  BlockVector missing = program_.linear->h;
  for (int64_t i = 0; i < loop_.count(); ++i) {
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    Vector3d multiplier = ToMultiplier(z[i]);
    multiplier[0] *= program_.bound;
    const Vector3d force = o.E.transpose() * multiplier;
    missing.points[o.point] -= view.cam_from_world_rotation.transpose() * force;
    missing.frames[view.frame] -=
        view.cam_from_rig_rotation.transpose() * force;
  }
  if (program_.linear->e) {
    missing.Add(-gauge_.Dot(missing) / gauge_.Dot(gauge_), gauge_);
  }
  BlockVector x;
  elimination_.Solve(missing, nullptr, &x);
  elimination_.Multiply(x, direction_.dz[0].data());
}

template <typename Cone>
int64_t NewtonSystem<Cone>::MemoryBytes(const KnownRotationProblem& problem) {
  constexpr int64_t kPerObservation =
      sizeof(NtScaling<Cone>) + 6 * sizeof(Vector) +
      2 * sizeof(Vector) +             // refinement
      3 * 3 * kDim * sizeof(double) +  // A_s, A_t, Q
      2 * sizeof(int32_t);             // structure and order
  constexpr int64_t kPerUnknown = 10 * sizeof(Vector3d);
  return static_cast<int64_t>(problem.observations.size()) * kPerObservation +
         (problem.num_points + problem.num_frames) * kPerUnknown +
         FrameSystem(AnchoredStructure(problem)).MemoryBytes();
}

template class NewtonSystem<SecondOrderCone>;
template class NewtonSystem<FourHalfLines>;

}  // namespace krot
