#include "krot/conic/excess_system.h"

#include <cmath>
#include <utility>

#include "krot/conic/block_structure.h"

namespace krot {

template <typename Cone>
ExcessSystem<Cone>::ExcessSystem(const KnownRotationProblem& problem, Norm norm,
                                 double bound, std::vector<double> costs,
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
      T_(ConeMap<kDim>(norm)),
      elimination_(structure_, num_threads),
      scaled_(problem.observations.size()),
      target_(problem.observations.size()),
      pulled_(problem.observations.size()) {
  direction_.ds.resize(problem.observations.size());
  direction_.dz.resize(problem.observations.size());
  direction_.dsigma.resize(problem.observations.size());
  direction_.dzeta.resize(problem.observations.size());
  gauge_.SetZero(problem_.num_points, problem_.num_frames);
  if (start == nullptr || !has_free_scale_ || !GaugeCentres(*start)) {
    GaugeDepths(depths);
  }
}

// e'x is the mean of w_i / depths_i.
template <typename Cone>
void ExcessSystem<Cone>::GaugeDepths(const std::vector<double>& depths) {
  for (int64_t i = 0; i < loop_.count(); ++i) {
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    const Eigen::Vector3d c = o.E.row(0).transpose() /
                              (static_cast<double>(loop_.count()) * depths[i]);
    gauge_.points[o.point] += view.cam_from_world_rotation.transpose() * c;
    if (structure_.frame_is_fixed[view.frame]) continue;
    gauge_.frames[view.frame] += view.cam_from_rig_rotation.transpose() * c;
  }
}

// e'x = sum_f C_f'(C_f^0 - mean C^0) over the same of the start, with
// C = -R_rw' t. False if all its centres are in one place.
template <typename Cone>
bool ExcessSystem<Cone>::GaugeCentres(const Estimate& start) {
  std::vector<Eigen::Matrix3d> rotations(problem_.num_frames);
  for (const View& view : problem_.views) {
    rotations[view.frame] =
        view.cam_from_rig_rotation.transpose() * view.cam_from_world_rotation;
  }
  std::vector<Eigen::Vector3d> centres;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int32_t f = 0; f < problem_.num_frames; ++f) {
    centres.push_back(-rotations[f].transpose() * start.translations[f]);
    mean += centres.back() / static_cast<double>(problem_.num_frames);
  }
  double size = 0;
  for (const Eigen::Vector3d& centre : centres) {
    size += (centre - mean).squaredNorm();
  }
  if (!(size > 0)) return false;
  for (int32_t f = 0; f < problem_.num_frames; ++f) {
    if (structure_.frame_is_fixed[f]) continue;
    gauge_.frames[f] = -rotations[f] * (centres[f] - mean) / size;
  }
  return true;
}

template <typename Cone>
double ExcessSystem<Cone>::Size(const Estimate& x) const {
  return gauge_.Dot({x.points, x.translations});
}

template <typename Cone>
bool ExcessSystem<Cone>::Factorize(const Iterate& at, double shortfall) {
  using Rows = Eigen::Matrix<double, kDim, 3, Eigen::RowMajor>;
  loop_.ForEach([&](int64_t i) {
    Scaled& own = scaled_[i];
    own.W = NtScaling<Cone>(Slack(at.viewed[i], at.sigma[i]), at.z[i]);
    own.lambda = own.W.Apply(at.z[i]);
    own.linear_lambda = std::sqrt(at.sigma[i] * at.zeta[i]);
    own.b = own.W.ApplyInverse(T_.col(0));
    own.d = std::sqrt(at.zeta[i] / at.sigma[i]);
    own.beta = own.b.squaredNorm() + own.d * own.d;
    own.kappa = (1 - own.d / std::sqrt(own.beta)) / own.b.squaredNorm();
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    Eigen::Matrix3d E = o.E;
    E.row(0) *= bound_;
    Rows rows;  // of x_cam
    for (int c = 0; c < 3; ++c) {
      const Vector column = own.W.ApplyInverse(T_ * E.col(c));
      rows.col(c) = column - own.kappa * own.b.dot(column) * own.b;
    }
    Eigen::Map<Rows>(elimination_.point_rows(i)).noalias() =
        rows * view.cam_from_world_rotation;
    Eigen::Map<Rows>(elimination_.frame_rows(i)).noalias() =
        rows * view.cam_from_rig_rotation;
  });
  mu_ = loop_.Sum([&](int64_t i) {
    const Scaled& own = scaled_[i];
    return own.lambda.squaredNorm() + own.linear_lambda * own.linear_lambda;
  }) / static_cast<double>(loop_.count() * (Cone::kDegree + 1));
  shortfall_ = shortfall;
  if (!elimination_.Factorize()) return false;
  elimination_.Solve(gauge_, nullptr, &x_gauge_);
  return true;
}

// W^-1 A dx of an observation.
template <typename Cone>
typename Cone::Vector ExcessSystem<Cone>::ScaledChange(const BlockVector& dx,
                                                       int64_t i) const {
  const Observation& o = problem_.observations[i];
  const View& view = problem_.views[o.view];
  Eigen::Vector3d change =
      o.E * (view.cam_from_world_rotation * dx.points[o.point] +
             view.cam_from_rig_rotation * dx.frames[view.frame]);
  change[0] *= bound_;
  return scaled_[i].W.ApplyInverse(T_ * change);
}

// - (W^-1 A)'b (d g - c) / beta: c itself, along b, where d vanishes.
template <typename Cone>
void ExcessSystem<Cone>::AddSaturatedForces(BlockVector* forces) const {
  for (int64_t i = 0; i < loop_.count(); ++i) {
    const Scaled& own = scaled_[i];
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    Eigen::Vector3d multiplier =
        T_.transpose() * own.W.ApplyInverse(own.b) *
        ((costs_[i] - own.d * target_[i].g) / own.beta);
    multiplier[0] *= bound_;
    const Eigen::Vector3d force = o.E.transpose() * multiplier;
    forces->points[o.point] += view.cam_from_world_rotation.transpose() * force;
    if (structure_.frame_is_fixed[view.frame]) continue;
    forces->frames[view.frame] +=
        view.cam_from_rig_rotation.transpose() * force;
  }
}

template <typename Cone>
void ExcessSystem<Cone>::SolveForTarget(double sigma) {
  BlockVector forces;
  forces.SetZero(problem_.num_points, problem_.num_frames);
  AddSaturatedForces(&forces);
  loop_.ForEach([&](int64_t i) {
    const Scaled& own = scaled_[i];
    const Vector& f = target_[i].f;
    pulled_[i] = f - own.kappa * own.b.dot(f) * own.b;
  });
  elimination_.Solve(forces, pulled_[0].data(), &x_target_);
  const double along = gauge_.Dot(x_target_);
  const double nu = has_free_scale_
                        ? (along - shortfall_) / gauge_.Dot(x_gauge_)
                        : (along + sigma) / (gauge_.Dot(x_gauge_) + 1 / mu_);
  Direction& d = direction_;
  d.dx = x_target_;
  d.dx.Add(-nu, x_gauge_);
  loop_.ForEach([&](int64_t i) {
    const Scaled& own = scaled_[i];
    const Target& target = target_[i];
    const Vector change = ScaledChange(d.dx, i);
    const double dsigma =
        (own.b.dot(target.f - change) + own.d * target.g - costs_[i]) /
        own.beta;
    d.ds[i] = change + dsigma * own.b;
    d.dz[i] = target.f - own.lambda - d.ds[i];
    d.dsigma[i] = own.d * dsigma;
    d.dzeta[i] = target.g - own.linear_lambda - d.dsigma[i];
  });
}

template class ExcessSystem<SecondOrderCone>;
template class ExcessSystem<FourHalfLines>;

}  // namespace krot
