#include "krot/conic/interior_point.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "krot/base/check.h"
#include "krot/conic/cones.h"
#include "krot/conic/nt_scaling.h"
#include "krot/conic/point_elimination.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// (N) Every pair keeps its smallest eigenvalue above this share of the mean.
constexpr double kNeighbourhood = 1e-3;
// (T) No depth grows by more than this factor in a step.
constexpr double kMaxDepthGrowth = 3;
// (F) After steps shorter than this, the next one only centres.
constexpr double kShortStep = 0.1;
// (theta) The bilinear term is used after steps longer than this.
constexpr double kLongStep = 0.5;
// Of the way to the boundary.
constexpr double kDamping = 0.98;
constexpr double kSmallestStep = 1e-8;

// T: (gamma w; v) into the cone.
template <typename Cone>
Eigen::Matrix<double, Cone::kDim, 3> ConeMap(Norm norm) {
  Eigen::Matrix<double, Cone::kDim, 3> T;
  if constexpr (Cone::kDim == 3) {
    T.setIdentity();
  } else if (norm.p == 1) {
    T << 1, 1, 1, 1, 1, -1, 1, -1, 1, 1, -1, -1;
  } else {
    T << 1, 1, 0, 1, -1, 0, 1, 0, 1, 1, 0, -1;
  }
  return T;
}

template <typename Cone>
class Solver {
 public:
  using Vector = typename Cone::Vector;

  Solver(const KnownRotationProblem& problem,
         const InteriorPointOptions& options, const Estimate& start)
      : problem_(problem),
        options_(options),
        T_(ConeMap<Cone>(options.norm)),
        x_(start),
        structure_(MakeStructure(problem)),
        elimination_(structure_, options.num_threads),
        n_(static_cast<int64_t>(problem.observations.size())) {
    for (auto* vectors : {&s_, &z_, &lambda_, &f_, &ds_, &dz_, &b_}) {
      vectors->resize(n_);
    }
    scaling_.resize(n_);
    viewed_.resize(n_);
    multipliers_.resize(n_);
    View(x_, &viewed_);
    cost_ = CostOf(viewed_);
    gamma_ = (1 + options.start_margin) * cost_;
    best_ = x_;
    best_cost_ = cost_;
    StartMultipliers();
  }

  InteriorPointSummary Run();

  const Estimate& best() const { return best_; }
  const std::vector<Multiplier>& multipliers() const { return multipliers_; }

 private:
  static BlockStructure MakeStructure(const KnownRotationProblem& problem) {
    BlockStructure structure;
    structure.rows_per_observation = Cone::kDim;
    structure.point_begin = problem.point_begin;
    structure.frame_of.reserve(problem.observations.size());
    for (const Observation& observation : problem.observations) {
      structure.frame_of.push_back(problem.views[observation.view].frame);
    }
    structure.frame_is_fixed.assign(problem.num_frames, 0);
    // The translation gauge: the frame with the most observations stays.
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

  void View(const Estimate& x, std::vector<ViewedPoint>* viewed) const {
    for (int64_t i = 0; i < n_; ++i) {
      (*viewed)[i] = ViewPoint(problem_, problem_.observations[i], x);
    }
  }

  double CostOf(const std::vector<ViewedPoint>& viewed) const {
    double cost = 0;
    for (const ViewedPoint& v : viewed) {
      cost = std::max(cost, ResidualOf(v, options_.norm));
    }
    return cost;
  }

  Vector Slack(const ViewedPoint& viewed, double gamma) const {
    return T_ * Vector3d(gamma * viewed.depth, viewed.v[0], viewed.v[1]);
  }

  void StartMultipliers() {
    double sum = 0;
    for (int64_t i = 0; i < n_; ++i) {
      s_[i] = Slack(viewed_[i], gamma_);
      z_[i] = Cone::Divide(s_[i], Cone::Identity());
      sum += (T_.transpose() * z_[i])[0] * viewed_[i].depth;
    }
    for (Vector& z : z_) z /= sum;
  }

  // Slacks, scaled rows and right-hand sides at (x, gamma).
  void Linearize() {
    gap_ = 0;
    for (int64_t i = 0; i < n_; ++i) {
      s_[i] = Slack(viewed_[i], gamma_);
      gap_ += s_[i].dot(z_[i]);
      scaling_[i] = NtScaling<Cone>(s_[i], z_[i]);
      lambda_[i] = scaling_[i].Apply(z_[i]);
      const Observation& o = problem_.observations[i];
      const krot::View& view = problem_.views[o.view];
      Matrix3d E;
      E.row(0) << 0, 0, gamma_;
      E.bottomRows<2>() << o.J, -o.J * o.u;
      FillRows(i, E * view.cam_from_world_rotation, elimination_.point_rows(i));
      FillRows(i, E * view.cam_from_rig_rotation, elimination_.frame_rows(i));
      b_[i] = scaling_[i].ApplyInverse(T_.col(0) * viewed_[i].depth);
    }
    mu_ = gap_ / (n_ * Cone::kDegree);
  }

  void FillRows(int64_t i, const Matrix3d& K, double* rows) {
    for (int c = 0; c < 3; ++c) {
      const Vector column = scaling_[i].ApplyInverse(T_ * K.col(c));
      for (int r = 0; r < Cone::kDim; ++r) rows[3 * r + c] = column[r];
    }
  }

  // sum_i weight_i c_i: the depth rows, over the unknowns.
  template <typename Weight>
  BlockVector SumDepthRows(const Weight& weight) const {
    BlockVector g;
    g.SetZero(problem_.num_points, problem_.num_frames);
    for (int64_t i = 0; i < n_; ++i) {
      const Observation& o = problem_.observations[i];
      const krot::View& view = problem_.views[o.view];
      const double q = weight(i);
      g.points[o.point] += q * view.cam_from_world_rotation.row(2).transpose();
      g.frames[view.frame] += q * view.cam_from_rig_rotation.row(2).transpose();
    }
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      if (structure_.frame_is_fixed[f]) g.frames[f].setZero();
    }
    return g;
  }

  static double Dot(const std::vector<Vector>& a,
                    const std::vector<Vector>& b) {
    double sum = 0;
    for (size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
    return sum;
  }

  void FactorBorder(bool bilinear);
  void SolveDirection();
  double MaxStep() const;
  void Multipliers();

  const KnownRotationProblem& problem_;
  const InteriorPointOptions& options_;
  const Eigen::Matrix<double, Cone::kDim, 3> T_;
  Estimate x_;
  BlockStructure structure_;
  PointElimination elimination_;
  int64_t n_;

  double gamma_ = 0;
  double cost_ = 0;
  double gap_ = 0;
  double mu_ = 0;
  Estimate best_;
  double best_cost_ = 0;
  std::vector<ViewedPoint> viewed_;
  std::vector<Vector> s_, z_, lambda_;
  std::vector<NtScaling<Cone>> scaling_;
  std::vector<Vector> b_;        // the border column of gamma, scaled
  std::vector<Vector> f_;        // the right-hand side, scaled
  std::vector<Vector> ds_, dz_;  // the direction, scaled
  std::vector<Multiplier> multipliers_;

  BlockVector bilinear_, border_, Xb_, Xe_, e_;
  double border_schur_ = 0;
  BlockVector dx_;
  double dgamma_ = 0;
  double nu_ = 0;
};

template <typename Cone>
void Solver<Cone>::FactorBorder(bool use_bilinear) {
  const double inverse_n = 1.0 / static_cast<double>(n_);
  e_ = SumDepthRows([&](int64_t i) { return inverse_n / viewed_[i].depth; });
  BlockVector zero;
  zero.SetZero(problem_.num_points, problem_.num_frames);
  elimination_.Solve(e_, nullptr, &Xe_);
  elimination_.Solve(zero, b_[0].data(), &Xb_);
  border_schur_ = 0;  // |b - A Xb|^2
  border_ = zero;
  for (int64_t i = 0; i < n_; ++i) {
    Vector rest;
    elimination_.MultiplyRows(i, Xb_, rest.data());
    border_schur_ += (b_[i] - rest).squaredNorm();
  }
  (void)use_bilinear;
}

template <typename Cone>
void Solver<Cone>::SolveDirection() {
  BlockVector zero;
  zero.SetZero(problem_.num_points, problem_.num_frames);
  BlockVector Xf;
  elimination_.Solve(zero, f_[0].data(), &Xf);
  // b'^T X for X = Xf, Xe, as b . (A X).
  double bXf = 0;
  double bXe = 0;
  for (int64_t i = 0; i < n_; ++i) {
    Vector rows;
    elimination_.MultiplyRows(i, Xf, rows.data());
    bXf += b_[i].dot(rows);
    elimination_.MultiplyRows(i, Xe_, rows.data());
    bXe += b_[i].dot(rows);
  }
  Eigen::Matrix2d M;
  M << border_schur_, -bXe, -e_.Dot(Xb_), -e_.Dot(Xe_);
  const Eigen::Vector2d rhs(Dot(b_, f_) - 1 - bXf, -e_.Dot(Xf));
  const Eigen::Vector2d solution = M.fullPivLu().solve(rhs);
  dgamma_ = solution[0];
  nu_ = solution[1];
  dx_ = Xf;
  dx_.Add(-dgamma_, Xb_);
  dx_.Add(-nu_, Xe_);
  for (int64_t i = 0; i < n_; ++i) {
    elimination_.MultiplyRows(i, dx_, ds_[i].data());
    ds_[i] += b_[i] * dgamma_;
    dz_[i] = f_[i] - lambda_[i] - ds_[i];
  }
}

template <typename Cone>
double Solver<Cone>::MaxStep() const {
  double step = 1 / kDamping;
  for (int64_t i = 0; i < n_; ++i) {
    step = Cone::MaxStep(lambda_[i], ds_[i], step);
    step = Cone::MaxStep(lambda_[i], dz_[i], step);
  }
  return step;
}

template <typename Cone>
void Solver<Cone>::Multipliers() {
  for (int64_t i = 0; i < n_; ++i) {
    const Vector3d z = T_.transpose() * z_[i];
    multipliers_[i] = {z[0], z.template tail<2>()};
  }
}

template <typename Cone>
InteriorPointSummary Solver<Cone>::Run() {
  InteriorPointSummary summary;
  summary.termination = InteriorPointTermination::kMaxIterations;
  double last_step = 1;
  for (int iteration = 1; iteration <= options_.max_iterations; ++iteration) {
    if (IsCancelled(options_.cancel)) {
      summary.termination = InteriorPointTermination::kInterrupted;
      break;
    }
    Linearize();
    if (!elimination_.Factorize()) {
      summary.termination = InteriorPointTermination::kSingular;
      break;
    }
    FactorBorder(last_step > kLongStep);

    // Predictor.
    const bool centre = last_step < kShortStep;
    double sigma = 0.8;
    if (!centre) {
      for (Vector& f : f_) f.setZero();
      SolveDirection();
      const double affine = std::min(1.0, MaxStep());
      double affine_gap = 0;
      for (int64_t i = 0; i < n_; ++i) {
        affine_gap +=
            (lambda_[i] + affine * ds_[i]).dot(lambda_[i] + affine * dz_[i]);
      }
      sigma = std::pow(std::max(0.0, affine_gap / gap_), 3);
      sigma = std::min(1.0, std::max(sigma, 1e-6));
    }
    // Corrector: lambda o f = sigma mu e - ds o dz.
    for (int64_t i = 0; i < n_; ++i) {
      Vector target = sigma * mu_ * Cone::Identity();
      if (!centre) target -= Cone::Product(ds_[i], dz_[i]);
      f_[i] = Cone::Divide(lambda_[i], target);
    }
    SolveDirection();
    double step = std::min(1.0, kDamping * MaxStep());

    // The slacks of the trial are exact: gamma w is not linear.
    Estimate trial;
    std::vector<ViewedPoint> viewed(n_);
    std::vector<Vector> z_trial(n_);
    for (;; step *= 0.7) {
      if (step < kSmallestStep) break;
      trial = x_;
      for (size_t k = 0; k < trial.points.size(); ++k) {
        trial.points[k] += step * dx_.points[k];
      }
      for (size_t f = 0; f < trial.translations.size(); ++f) {
        trial.translations[f] += step * dx_.frames[f];
      }
      const double gamma = gamma_ + step * dgamma_;
      View(trial, &viewed);
      bool ok = gamma > 0;
      double gap = 0;
      for (int64_t i = 0; i < n_ && ok; ++i) {
        z_trial[i] = z_[i] + step * scaling_[i].ApplyInverse(dz_[i]);
        const Vector s = Slack(viewed[i], gamma);
        ok = viewed[i].depth > 0 &&
             viewed[i].depth < kMaxDepthGrowth * viewed_[i].depth &&
             Cone::SmallestEigenvalue(s) > 0 &&
             Cone::SmallestEigenvalue(z_trial[i]) > 0;
        gap += s.dot(z_trial[i]);
      }
      if (!ok) continue;
      const double mu = gap / (n_ * Cone::kDegree);
      for (int64_t i = 0; i < n_ && ok; ++i) {
        const Vector s = Slack(viewed[i], gamma);
        const Vector scaled = NtScaling<Cone>(s, z_trial[i]).Apply(z_trial[i]);
        const double root = Cone::SmallestEigenvalue(scaled);
        ok = root * root >= kNeighbourhood * mu;
      }
      if (!ok) continue;
      x_ = trial;
      viewed_.swap(viewed);
      z_.swap(z_trial);
      gamma_ = gamma;
      gap_ = gap;
      break;
    }
    summary.iterations = iteration;
    if (step < kSmallestStep) {
      summary.termination = InteriorPointTermination::kNoProgress;
      break;
    }
    cost_ = CostOf(viewed_);
    if (cost_ < best_cost_) {
      best_cost_ = cost_;
      best_ = x_;
    }
    last_step = step;
    Multipliers();
    const ConicIterate iterate{iteration, gamma_, cost_,        gap_ / gamma_,
                               step,      &x_,    &multipliers_};
    if (options_.stop && options_.stop(iterate)) {
      summary.termination = InteriorPointTermination::kStopped;
      break;
    }
    if (gap_ / gamma_ <= options_.smallest_gap) {
      summary.termination = InteriorPointTermination::kSmallestGap;
      break;
    }
  }
  summary.gamma = gamma_;
  summary.gap = gap_ / gamma_;
  return summary;
}

template <typename Cone>
InteriorPointSummary Run(const KnownRotationProblem& problem,
                         const InteriorPointOptions& options,
                         Estimate* estimate,
                         std::vector<Multiplier>* multipliers) {
  Solver<Cone> solver(problem, options, *estimate);
  const InteriorPointSummary summary = solver.Run();
  *estimate = solver.best();
  *multipliers = solver.multipliers();
  return summary;
}

}  // namespace

InteriorPointSummary MinimizeJointly(const KnownRotationProblem& problem,
                                     const InteriorPointOptions& options,
                                     Estimate* estimate,
                                     std::vector<Multiplier>* multipliers) {
  if (options.norm.p == 2) {
    return Run<SecondOrderCone>(problem, options, estimate, multipliers);
  }
  CheckArgument(options.norm.IsPolyhedral(), "norm.p", options.norm.p,
                "1, 2 or infinity");
  return Run<FourHalfLines>(problem, options, estimate, multipliers);
}

}  // namespace krot
