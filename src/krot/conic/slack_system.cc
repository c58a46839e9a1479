#include "krot/conic/slack_system.h"

#include <cmath>
#include <utility>

namespace krot {

using Eigen::Matrix3d;
using Eigen::Vector3d;

template <typename BoundCone>
SlackSystem<BoundCone>::SlackSystem(const KnownRotationProblem& problem,
                                    Norm norm, double bound,
                                    std::vector<double> costs,
                                    const std::vector<double>& depths,
                                    double min_depth, const Estimate* start,
                                    int num_threads)
    : problem_(problem),
      loop_(static_cast<int64_t>(problem.observations.size()), num_threads),
      has_free_scale_(!HasBaseline(problem)),
      bound_(bound),
      min_depth_(min_depth),
      costs_(std::move(costs)),
      structure_(AnchoredStructure(problem)),
      rig_from_world_(RigFromWorldRotations(problem)),
      T_(ConeMap<kDim>(norm)),
      least_squares_(structure_, {num_threads}),
      scaled_(problem.observations.size()),
      lambda_(problem.observations.size()),
      target_(problem.observations.size()),
      rest_(problem.observations.size()) {
  direction_.ds.resize(problem.observations.size());
  direction_.dz.resize(problem.observations.size());
  direction_.dsigma.resize(problem.observations.size());
  if (start != nullptr && has_free_scale_) gauge_ = CentresGauge(*start);
  if (gauge_.frames.empty()) {  // e'x is the mean of w_i / depths_i
    gauge_ = GradientOf(problem, structure_, [&](int64_t i) -> Vector3d {
      return {1 / (static_cast<double>(loop_.count()) * depths[i]), 0, 0};
    });
  }
}

// e'x = sum_f C_f'(C_f^0 - mean C^0) over the same of the start. Empty if all
// its centres are in one place.
template <typename BoundCone>
BlockVector SlackSystem<BoundCone>::CentresGauge(const Estimate& start) const {
  const std::vector<Vector3d> centres =
      CentresOf(rig_from_world_, start.translations);
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& centre : centres) {
    mean += centre / static_cast<double>(centres.size());
  }
  double size = 0;
  for (const Vector3d& centre : centres) size += (centre - mean).squaredNorm();
  if (!(size > 0)) return {};
  BlockVector gauge;
  gauge.SetZero(problem_.num_points, problem_.num_frames);
  for (int32_t f = 0; f < problem_.num_frames; ++f) {
    if (structure_.frame_is_fixed[f]) continue;
    gauge.frames[f] = (centres[f] - mean) / size;
  }
  return gauge;
}

template <typename BoundCone>
double SlackSystem<BoundCone>::Size(const Estimate& x) const {
  return gauge_.Dot({x.points, CentresOf(rig_from_world_, x.translations)});
}

template <typename BoundCone>
void SlackSystem<BoundCone>::ViewAll(State* state) const {
  state->viewed.resize(problem_.observations.size());
  loop_.ForEach([&](int64_t i) {
    state->viewed[i] = ViewPoint(problem_, problem_.observations[i], state->x);
  });
}

template <typename BoundCone>
void SlackSystem<BoundCone>::Move(const State& from, double step,
                                  State* to) const {
  MoveCentres(rig_from_world_, from.x, step, direction_.dx, &to->x);
  ViewAll(to);
  loop_.ForEach([&](int64_t i) {
    to->sigma[i] = from.sigma[i] + step * direction_.dsigma[i];
  });
}

template <typename BoundCone>
bool SlackSystem<BoundCone>::Factorize(const State& at, double shortfall) {
  using Rows = Eigen::Matrix<double, kDim, 3, Eigen::RowMajor>;
  loop_.ForEach([&](int64_t i) {
    Scaled& own = scaled_[i];
    const double zeta = Cone::Last(at.z[i]);
    own.W = NtScaling<BoundCone>(BoundSlack(at.viewed[i], at.sigma[i]),
                                 Cone::Head(at.z[i]));
    own.b = own.W.ApplyInverse(T_.col(0));
    own.d = std::sqrt(zeta / at.sigma[i]);
    own.beta = own.b.squaredNorm() + own.d * own.d;
    own.kappa = (1 - own.d / std::sqrt(own.beta)) / own.b.squaredNorm();
    lambda_[i] = Cone::Join(own.W.Apply(Cone::Head(at.z[i])),
                            std::sqrt(at.sigma[i] * zeta));
    const Observation& o = problem_.observations[i];
    Matrix3d E = o.E;
    E.row(0) *= bound_;
    Rows rows;  // of x_cam
    for (int c = 0; c < 3; ++c) {
      const BoundVector column = own.W.ApplyInverse(T_ * E.col(c));
      rows.col(c) = column - own.kappa * own.b.dot(column) * own.b;
    }
    Eigen::Map<Rows>(least_squares_.rows(i)).noalias() =
        rows * problem_.views[o.view].cam_from_world_rotation;
  });
  mu_ = loop_.Sum([&](int64_t i) { return lambda_[i].squaredNorm(); }) /
        static_cast<double>(loop_.count() * Cone::kDegree);
  shortfall_ = shortfall;
  if (!least_squares_.Factorize()) return false;
  least_squares_.SolveRefined(&gauge_, nullptr, &x_gauge_);
  return true;
}

// W^-1 A dx of an observation.
template <typename BoundCone>
typename BoundCone::Vector SlackSystem<BoundCone>::ScaledChange(
    const BlockVector& dx, int64_t i) const {
  const Observation& o = problem_.observations[i];
  const View& view = problem_.views[o.view];
  Vector3d change = o.E * (view.cam_from_world_rotation *
                           (dx.points[o.point] - dx.frames[view.frame]));
  change[0] *= bound_;
  return scaled_[i].W.ApplyInverse(T_ * change);
}

template <typename BoundCone>
void SlackSystem<BoundCone>::SolveForTarget(double sigma) {
  // - (W^-1 A)'b (d g - c) / beta: c itself, along b, where d vanishes.
  const BlockVector gradient =
      GradientOf(problem_, structure_, [&](int64_t i) -> Vector3d {
        const Scaled& own = scaled_[i];
        Vector3d multiplier =
            T_.transpose() * own.W.ApplyInverse(own.b) *
            ((costs_[i] - own.d * Cone::Last(target_[i])) / own.beta);
        multiplier[0] *= bound_;
        return multiplier;
      });
  loop_.ForEach([&](int64_t i) {
    const Scaled& own = scaled_[i];
    const BoundVector f = Cone::Head(target_[i]);
    rest_[i] = f - own.kappa * own.b.dot(f) * own.b;
  });
  least_squares_.SolveRefined(&gradient, rest_[0].data(), &x_target_);
  const double along = gauge_.Dot(x_target_);
  const double nu = has_free_scale_
                        ? (along - shortfall_) / gauge_.Dot(x_gauge_)
                        : (along + sigma) / (gauge_.Dot(x_gauge_) + 1 / mu_);
  Direction& d = direction_;
  d.dx = x_target_;
  d.dx.Add(-nu, x_gauge_);
  loop_.ForEach([&](int64_t i) {
    const Scaled& own = scaled_[i];
    const BoundVector f = Cone::Head(target_[i]);
    const double g = Cone::Last(target_[i]);
    const BoundVector change = ScaledChange(d.dx, i);
    d.dsigma[i] = (own.b.dot(f - change) + own.d * g - costs_[i]) / own.beta;
    d.ds[i] = Cone::Join(change + d.dsigma[i] * own.b, own.d * d.dsigma[i]);
    d.dz[i] = target_[i] - lambda_[i] - d.ds[i];
  });
}

template class SlackSystem<SecondOrderCone>;
template class SlackSystem<FourHalfLines>;

}  // namespace krot
