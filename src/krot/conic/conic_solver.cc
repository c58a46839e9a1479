#include "krot/conic/conic_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "krot/base/parallel_for.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Every pair keeps its smallest eigenvalue above this share of their mean.
constexpr double kNeighbourhood = 1e-3;
// No depth grows by more than this factor in a step.
constexpr double kMaxDepthGrowth = 3;
// After a step shorter than this, the next one only centres.
constexpr double kShortStep = 0.1;
constexpr double kCentring = 0.8;
constexpr double kSmallestSigma = 1e-6;
// Of the way to the boundary, and of a step that left the neighbourhood.
constexpr double kDamping = 0.98;
constexpr double kBacktracking = 0.7;
constexpr double kSmallestStep = 1e-8;
constexpr int64_t kObservationsPerChunk = 4096;

template <int kDim>
Eigen::Matrix<double, kDim, 3> ConeMap(Norm norm) {
  Eigen::Matrix<double, kDim, 3> T;
  if constexpr (kDim == 3) {
    T.setIdentity();
  } else if (norm.p == 1) {  // top +- v1 +- v2
    T << 1, 1, 1, 1, 1, -1, 1, -1, 1, 1, -1, -1;
  } else {  // top +- v1, top +- v2
    T << 1, 1, 0, 1, -1, 0, 1, 0, 1, 1, 0, -1;
  }
  return T;
}

// The translation gauge: the frame with the most observations stays put.
BlockStructure MakeStructure(const KnownRotationProblem& problem) {
  BlockStructure structure;
  structure.point_begin = problem.point_begin;
  structure.frame_of.reserve(problem.observations.size());
  for (const Observation& observation : problem.observations) {
    structure.frame_of.push_back(problem.views[observation.view].frame);
  }
  structure.frame_is_fixed.assign(problem.num_frames, 0);
  int32_t anchor = 0;
  for (int32_t f = 1; f < problem.num_frames; ++f) {
    if (problem.frame_begin[f + 1] - problem.frame_begin[f] >
        problem.frame_begin[anchor + 1] - problem.frame_begin[anchor]) {
      anchor = f;
    }
  }
  if (problem.num_frames > 0) structure.frame_is_fixed[anchor] = 1;
  return structure;
}

bool HasBaseline(const KnownRotationProblem& problem) {
  return std::any_of(problem.views.begin(), problem.views.end(),
                     [](const View& view) {
                       return !view.cam_from_rig_translation.isZero(0);
                     });
}

void Move(const BlockVector& direction, double step, Estimate* x) {
  for (size_t k = 0; k < x->points.size(); ++k) {
    x->points[k] += step * direction.points[k];
  }
  for (size_t f = 0; f < x->translations.size(); ++f) {
    x->translations[f] += step * direction.frames[f];
  }
}

}  // namespace

template <typename Cone>
ConicSolver<Cone>::ConicSolver(const KnownRotationProblem& problem,
                               const InteriorPointOptions& options,
                               const ConeProgram& program,
                               const Estimate& start, double scalar)
    : problem_(problem),
      options_(options),
      program_(program),
      n_(static_cast<int64_t>(problem.observations.size())),
      has_free_scale_(program.IsCost() && !HasBaseline(problem)),
      structure_(MakeStructure(problem)),
      T_(ConeMap<kDim>(options.norm)),
      elimination_(structure_, options.num_threads),
      multipliers_(n_),
      scaling_(n_),
      lambda_(n_),
      border_(n_),
      target_(n_),
      ds_(n_),
      dz_(n_),
      rest_(n_) {
  now_.x = start;
  now_.scalar = scalar;
  now_.viewed.resize(n_);
  now_.z.resize(n_);
  trial_ = now_;
  ViewAll(&now_);
  CentreMultipliers();
  best_ = start;
  best_cost_ = now_.cost;
}

template <typename Cone>
template <typename Body>
void ConicSolver<Cone>::ForObservations(const Body& body) const {
  ParallelFor(n_, kObservationsPerChunk, options_.num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t i = begin; i < end; ++i) body(i);
              });
}

template <typename Cone>
template <typename Term>
double ConicSolver<Cone>::Sum(const Term& term) const {
  std::vector<double> sums(NumChunks(n_, kObservationsPerChunk), 0.0);
  ParallelFor(n_, kObservationsPerChunk, options_.num_threads,
              [&](int64_t begin, int64_t end, int) {
                double sum = 0;
                for (int64_t i = begin; i < end; ++i) sum += term(i);
                sums[begin / kObservationsPerChunk] = sum;
              });
  double sum = 0;
  for (const double part : sums) sum += part;
  return sum;
}

template <typename Cone>
template <typename Term>
double ConicSolver<Cone>::Min(const Term& term) const {
  std::vector<double> mins(NumChunks(n_, kObservationsPerChunk));
  ParallelFor(n_, kObservationsPerChunk, options_.num_threads,
              [&](int64_t begin, int64_t end, int) {
                double least = std::numeric_limits<double>::infinity();
                for (int64_t i = begin; i < end; ++i) {
                  least = std::min(least, term(i));
                }
                mins[begin / kObservationsPerChunk] = least;
              });
  return *std::min_element(mins.begin(), mins.end());
}

template <typename Cone>
typename Cone::Vector ConicSolver<Cone>::Slack(const ViewedPoint& viewed,
                                               double scalar) const {
  return T_ *
         Vector3d(program_.Top(viewed.depth, scalar), viewed.v[0], viewed.v[1]);
}

template <typename Cone>
void ConicSolver<Cone>::ViewAll(State* state) const {
  ForObservations([&](int64_t i) {
    state->viewed[i] = ViewPoint(problem_, problem_.observations[i], state->x);
  });
  state->cost = -Min(
      [&](int64_t i) { return -ResidualOf(state->viewed[i], options_.norm); });
}

// z = mu s^-1: perfectly centred, scaled so that the row of g holds.
template <typename Cone>
void ConicSolver<Cone>::CentreMultipliers() {
  ForObservations([&](int64_t i) {
    now_.z[i] =
        Cone::Divide(Slack(now_.viewed[i], now_.scalar), Cone::Identity());
  });
  const double sum = Sum([&](int64_t i) {
    return T_.col(0).dot(now_.z[i]) *
           program_.TopPerScalar(now_.viewed[i].depth);
  });
  ForObservations([&](int64_t i) { now_.z[i] /= sum; });
}

// The scaled rows at the iterate.
template <typename Cone>
void ConicSolver<Cone>::Linearize() {
  const double top_per_depth = program_.TopPerDepth(now_.scalar);
  ForObservations([&](int64_t i) {
    const ViewedPoint& viewed = now_.viewed[i];
    scaling_[i] = NtScaling<Cone>(Slack(viewed, now_.scalar), now_.z[i]);
    lambda_[i] = scaling_[i].Apply(now_.z[i]);
    border_[i] = scaling_[i].ApplyInverse(T_.col(0) *
                                          program_.TopPerScalar(viewed.depth));
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    Matrix3d E;
    E.row(0) << 0, 0, top_per_depth;
    E.template bottomRows<2>() << o.J, -o.J * o.u;
    FillRows(i, E * view.cam_from_world_rotation, elimination_.point_rows(i));
    FillRows(i, E * view.cam_from_rig_rotation, elimination_.frame_rows(i));
  });
  now_.gap = Sum([&](int64_t i) { return lambda_[i].squaredNorm(); });
  mu_ = now_.gap / static_cast<double>(n_ * Cone::kDegree);
}

template <typename Cone>
void ConicSolver<Cone>::FillRows(int64_t i, const Matrix3d& K,
                                 double* rows) const {
  for (int c = 0; c < 3; ++c) {
    const Vector column = scaling_[i].ApplyInverse(T_ * K.col(c));
    for (int r = 0; r < kDim; ++r) rows[3 * r + c] = column[r];
  }
}

// e = mean of c_i / w_i: e'dx is the mean relative change of the depths.
template <typename Cone>
BlockVector ConicSolver<Cone>::GaugeRow() const {
  BlockVector e;
  e.SetZero(problem_.num_points, problem_.num_frames);
  if (!program_.IsCost()) return e;
  for (int64_t i = 0; i < n_; ++i) {
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    const double weight = 1 / (static_cast<double>(n_) * now_.viewed[i].depth);
    e.points[o.point] +=
        weight * view.cam_from_world_rotation.row(2).transpose();
    e.frames[view.frame] +=
        weight * view.cam_from_rig_rotation.row(2).transpose();
  }
  for (int32_t f = 0; f < problem_.num_frames; ++f) {
    if (structure_.frame_is_fixed[f]) e.frames[f].setZero();
  }
  return e;
}

// What the border of the system needs of the factorised part.
template <typename Cone>
void ConicSolver<Cone>::SolveBorder() {
  BlockVector zero;
  zero.SetZero(problem_.num_points, problem_.num_frames);
  elimination_.Solve(zero, border_[0].data(), &x_border_);
  gauge_ = GaugeRow();
  elimination_.Solve(gauge_, nullptr, &x_gauge_);
  elimination_.Multiply(x_border_, rest_[0].data());
  ForObservations([&](int64_t i) { rest_[i] = border_[i] - rest_[i]; });
}

// The direction for the targets f, and the multipliers'. With H = A'A and
// dx = Xf - Xb dg - Xe nu, the rows of g and of the gauge are
//   (b - A Xb)'b dg - b'A Xe nu = b'(f - A Xf) - 1,
//   e'dx = 0                  where the scale is free,
//   nu = mu (e'dx + sigma)    where baselines set it: depths are only kept
//                             from growing without bound, less and less.
template <typename Cone>
void ConicSolver<Cone>::SolveDirection(double sigma) {
  BlockVector zero;
  zero.SetZero(problem_.num_points, problem_.num_frames);
  elimination_.Solve(zero, target_[0].data(), &x_target_);
  Eigen::Matrix2d M;
  Eigen::Vector2d rhs;
  M(0, 0) = Sum([&](int64_t i) { return rest_[i].squaredNorm(); });
  // b'A X = (A'b)'X = (H Xb)'X, and (b - A Xb)'f = b'f - b'A Xf.
  M(0, 1) = -x_border_.Dot(gauge_);
  rhs[0] = Sum([&](int64_t i) { return rest_[i].dot(target_[i]); }) - 1;
  M(1, 0) = -gauge_.Dot(x_border_);
  M(1, 1) = -gauge_.Dot(x_gauge_);
  rhs[1] = -gauge_.Dot(x_target_);
  if (!program_.IsCost()) {
    M(0, 1) = M(1, 0) = rhs[1] = 0;
    M(1, 1) = 1;
  } else if (!has_free_scale_) {
    M(1, 1) -= 1 / mu_;
    rhs[1] -= sigma;
  }
  const Eigen::Vector2d solution = M.fullPivLu().solve(rhs);
  dscalar_ = solution[0];
  dx_ = x_target_;
  dx_.Add(-dscalar_, x_border_);
  dx_.Add(-solution[1], x_gauge_);
  elimination_.Multiply(dx_, ds_[0].data());
  ForObservations([&](int64_t i) {
    ds_[i] += dscalar_ * border_[i];
    dz_[i] = target_[i] - lambda_[i] - ds_[i];
  });
}

// Mehrotra's choice: the cube of what the predictor leaves of the gap.
template <typename Cone>
double ConicSolver<Cone>::AffineSigma() const {
  const double step = std::min(1.0, MaxStep());
  const double gap = Sum([&](int64_t i) {
    return (lambda_[i] + step * ds_[i]).dot(lambda_[i] + step * dz_[i]);
  });
  const double left = std::max(0.0, gap / now_.gap);
  return std::min(1.0, std::max(kSmallestSigma, left * left * left));
}

template <typename Cone>
double ConicSolver<Cone>::MaxStep() const {
  return Min([&](int64_t i) {
    const double step = Cone::MaxStep(lambda_[i], ds_[i], 1 / kDamping);
    return Cone::MaxStep(lambda_[i], dz_[i], step);
  });
}

template <typename Cone>
bool ConicSolver<Cone>::IsInside(const State& trial,
                                 double largest_growth) const {
  if (!(trial.scalar > 0) && program_.IsCost()) return false;
  const double mu = trial.gap / static_cast<double>(n_ * Cone::kDegree);
  return Min([&](int64_t i) {
           const ViewedPoint& viewed = trial.viewed[i];
           const Vector s = Slack(viewed, trial.scalar);
           if (program_.IsCost() &&
               (!(viewed.depth > 0) ||
                viewed.depth > largest_growth * now_.viewed[i].depth)) {
             return -1.0;
           }
           if (!(Cone::SmallestEigenvalue(s) > 0) ||
               !(Cone::SmallestEigenvalue(trial.z[i]) > 0)) {
             return -1.0;
           }
           const double root = Cone::SmallestEigenvalue(
               NtScaling<Cone>(s, trial.z[i]).Apply(trial.z[i]));
           return root * root - kNeighbourhood * mu;
         }) >= 0;
}

// The longest tried step that stays in the neighbourhood of the path; 0 if
// none does.
template <typename Cone>
double ConicSolver<Cone>::TakeStep() {
  ForObservations(
      [&](int64_t i) { dz_[i] = scaling_[i].ApplyInverse(dz_[i]); });
  for (double step = std::min(1.0, kDamping * last_max_step_);
       step >= kSmallestStep; step *= kBacktracking) {
    trial_.x = now_.x;
    Move(dx_, step, &trial_.x);
    trial_.scalar = now_.scalar + step * dscalar_;
    ViewAll(&trial_);
    ForObservations(
        [&](int64_t i) { trial_.z[i] = now_.z[i] + step * dz_[i]; });
    trial_.gap = Sum([&](int64_t i) {
      return Slack(trial_.viewed[i], trial_.scalar).dot(trial_.z[i]);
    });
    if (IsInside(trial_, kMaxDepthGrowth)) {
      std::swap(now_, trial_);
      return step;
    }
  }
  return 0;
}

template <typename Cone>
void ConicSolver<Cone>::ExportMultipliers() {
  ForObservations([&](int64_t i) {
    const Vector3d z = T_.transpose() * now_.z[i];
    multipliers_[i] = {z[0], z.template tail<2>()};
  });
}

template <typename Cone>
InteriorPointSummary ConicSolver<Cone>::Run() {
  InteriorPointSummary summary;
  summary.termination = InteriorPointTermination::kMaxIterations;
  double step = 1;
  while (summary.iterations < options_.max_iterations) {
    if (IsCancelled(options_.cancel)) {
      summary.termination = InteriorPointTermination::kInterrupted;
      break;
    }
    Linearize();
    if (!elimination_.Factorize()) {
      summary.termination = InteriorPointTermination::kSingular;
      break;
    }
    SolveBorder();
    const bool only_centre = step < kShortStep;
    double sigma = kCentring;
    if (!only_centre) {
      for (Vector& f : target_) f.setZero();
      SolveDirection(0);
      sigma = AffineSigma();
    }
    ForObservations([&](int64_t i) {
      Vector target = sigma * mu_ * Cone::Identity();
      if (!only_centre) target -= Cone::Product(ds_[i], dz_[i]);
      target_[i] = Cone::Divide(lambda_[i], target);
    });
    SolveDirection(sigma);
    last_max_step_ = MaxStep();
    step = TakeStep();
    ++summary.iterations;
    if (!(step > 0)) {
      summary.termination = InteriorPointTermination::kNoProgress;
      break;
    }
    ExportMultipliers();
    summary.gamma = now_.scalar;
    summary.gap = now_.gap / now_.scalar;
    if (now_.cost < best_cost_) {
      best_cost_ = now_.cost;
      best_ = now_.x;
    }
    const ConicIterate iterate{summary.iterations, now_.scalar, now_.cost,
                               summary.gap,        step,        &now_.x,
                               &multipliers_};
    if (options_.stop && options_.stop(iterate)) {
      summary.termination = InteriorPointTermination::kStopped;
      break;
    }
    if (!program_.IsCost() && now_.cost < program_.bound) {
      best_ = now_.x;
      summary.termination = InteriorPointTermination::kFeasible;
      break;
    }
    if (summary.gap <= options_.smallest_gap) {
      summary.termination = InteriorPointTermination::kSmallestGap;
      break;
    }
  }
  return summary;
}

template <typename Cone>
int64_t ConicSolver<Cone>::MemoryBytes(const KnownRotationProblem& problem) {
  const int64_t per_observation =
      sizeof(Multiplier) + sizeof(NtScaling<Cone>) + 8 * sizeof(Vector) +
      2 * sizeof(ViewedPoint) + 2 * sizeof(Vector) +  // refinement
      3 * 3 * kDim * sizeof(double) + sizeof(int32_t);
  const int64_t per_unknown = 12 * sizeof(Vector3d);
  return static_cast<int64_t>(problem.observations.size()) * per_observation +
         (problem.num_points + problem.num_frames) * per_unknown +
         FrameSystem(MakeStructure(problem)).MemoryBytes();
}

template class ConicSolver<SecondOrderCone>;
template class ConicSolver<FourHalfLines>;

}  // namespace krot
