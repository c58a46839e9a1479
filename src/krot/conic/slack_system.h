#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "krot/conic/cones.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"
#include "krot/math/norm.h"
#include "krot/problem/centre_unknowns.h"
#include "krot/problem/cost.h"

namespace krot::internal {

// The slack programme (interior_point.h) and its Newton system at an iterate.
// Every observation has two pairs: T (b w_i + sigma_i; v_i) in the cone, and
// sigma_i in the half-line; s_i and z_i are both together. A direction
// minimises
//
//   1/2 sum_i |W_i^-1 ds_i - f_i|^2 + (d_i dsigma_i - g_i)^2 + c_i dsigma_i,
//   ds_i = A_i dx + q dsigma_i,   d_i^2 = zeta_i / sigma_i,   q = T e_1,
//
// along the gauge. With b = W^-1 q and beta = b'b + d^2, an observation's own
// unknown is dsigma = (b'(f - W^-1 A dx) + d g - c) / beta. Eliminating it
// turns the rows W^-1 A into S W^-1 A with
//
//   S S = I - b b' / beta,   S = I - kappa b b',
//
// which are the rows of CentredLeastSquares. If sigma is large, an observation
// has hardly any weight along b.
template <typename BoundCone>
class SlackSystem {
 public:
  using Cone = WithHalfLine<BoundCone>;
  using Vector = typename Cone::Vector;
  using Vector3d = Eigen::Vector3d;
  static constexpr int kNumCorrectors = 0;
  static constexpr bool kGapAfterOwnSteps = true;

  struct State {
    Estimate x;
    std::vector<ViewedPoint> viewed;
    std::vector<double> sigma;
    std::vector<Vector> z;  // (z; zeta)
    double gap = 0;         // sum s'z
  };

  // The result of Solve; ds and dz are scaled by W and d.
  struct Direction {
    BlockVector dx;
    std::vector<double> dsigma;
    std::vector<Vector> ds, dz;
  };

  // `costs` are the c_i. Where the scale is free and `start` is given, the
  // gauge is the size of the frames' centres along those of `start`; otherwise,
  // or if these coincide, e'x is the mean of w_i / depths_i.
  SlackSystem(const KnownRotationProblem& problem, Norm norm, double bound,
              std::vector<double> costs, const std::vector<double>& depths,
              double min_depth, const Estimate* start, int num_threads)
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
    if (gauge_.frames.empty()) {
      gauge_ = GradientOf(problem, structure_, [&](int64_t i) -> Vector3d {
        return {1 / (static_cast<double>(loop_.count()) * depths[i]), 0, 0};
      });
    }
  }

  // e'x, without the contribution of the frame that is held fixed.
  double Size(const Estimate& x) const {
    return gauge_.Dot({x.points, CentresOf(rig_from_world_, x.translations)});
  }

  // Sets state->viewed, the depth and v of every observation, from x.
  void ViewAll(State* state) const {
    state->viewed.resize(problem_.observations.size());
    loop_.ForEach([&](int64_t i) {
      state->viewed[i] =
          ViewPoint(problem_, problem_.observations[i], state->x);
    });
  }

  // T (b w + sigma; v) in the bound's cone.
  typename BoundCone::Vector BoundSlack(const ViewedPoint& viewed,
                                        double sigma) const {
    return T_ * Eigen::Vector3d(bound_ * (viewed.depth - min_depth_) + sigma,
                                viewed.v[0], viewed.v[1]);
  }
  Vector Slack(const State& state, int64_t i) const {
    return Cone::Join(BoundSlack(state.viewed[i], state.sigma[i]),
                      state.sigma[i]);
  }
  // q'z, the multiplier of the slack.
  double Multiplier(const typename BoundCone::Vector& z) const {
    return T_.col(0).dot(z);
  }
  bool HasOneStep() const { return false; }
  void Move(const State& from, double step, State* to) const {
    MoveCentres(rig_from_world_, from.x, step, direction_.dx, &to->x);
    ViewAll(to);
    loop_.ForEach([&](int64_t i) {
      to->sigma[i] = from.sigma[i] + step * direction_.dsigma[i];
    });
  }

  bool IsPlausible(const State&, const State&, int64_t) const { return true; }

  // Factorises at an iterate; false if that fails. Where the scale is free, e'x
  // is to grow by `shortfall`.
  bool Factorize(const State& at, double shortfall) {
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
      Eigen::Matrix3d E = o.E;
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

  // Finds the direction for the targets (f; g) = target(i), which may depend on
  // the last direction; `sigma` is the centring of the gauge's row, used where
  // baselines set the scale.
  template <typename MakeTarget>
  void Solve(const MakeTarget& target, double sigma) {
    loop_.ForEach([&](int64_t i) { target_[i] = target(i); });
    SolveForTarget(sigma);
  }

  const ObservationLoop& loop() const { return loop_; }
  double mu() const { return mu_; }  // of each pair
  const std::vector<Vector>& lambda() const { return lambda_; }
  const Direction& direction() const { return direction_; }
  // The multipliers' direction, with the scaling removed.
  Vector UnscaledDz(int64_t i) const {
    const Scaled& own = scaled_[i];
    const Vector& dz = direction_.dz[i];
    return Cone::Join(own.W.ApplyInverse(Cone::Head(dz)),
                      own.d * Cone::Last(dz));
  }

 private:
  static constexpr int kDim = BoundCone::kDim;
  using BoundVector = typename BoundCone::Vector;

  struct Scaled {
    NtScaling<BoundCone> W;
    BoundVector b = BoundVector::Zero();
    double d = 0;
    double beta = 0;
    double kappa = 0;
  };

  // The e with e'x = sum_f C_f'(C_f^0 - mean C^0), divided by the same sum for
  // the start. Empty if all centres of the start are in one place.
  BlockVector CentresGauge(const Estimate& start) const {
    const std::vector<Vector3d> centres =
        CentresOf(rig_from_world_, start.translations);
    Vector3d mean = Vector3d::Zero();
    for (const Vector3d& centre : centres) {
      mean += centre / static_cast<double>(centres.size());
    }
    double size = 0;
    for (const Vector3d& centre : centres)
      size += (centre - mean).squaredNorm();
    if (!(size > 0)) return {};
    BlockVector gauge;
    gauge.SetZero(problem_.num_points, problem_.num_frames);
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      if (structure_.frame_is_fixed[f]) continue;
      gauge.frames[f] = (centres[f] - mean) / size;
    }
    return gauge;
  }

  // W^-1 A dx of an observation.
  BoundVector ScaledChange(const BlockVector& dx, int64_t i) const {
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    Vector3d change = o.E * (view.cam_from_world_rotation *
                             (dx.points[o.point] - dx.frames[view.frame]));
    change[0] *= bound_;
    return scaled_[i].W.ApplyInverse(T_ * change);
  }

  void SolveForTarget(double sigma) {
    // The right-hand side is -(W^-1 A)'b (d g - c) / beta.
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

  const KnownRotationProblem& problem_;
  const ObservationLoop loop_;
  const bool has_free_scale_;
  const double bound_;
  const double min_depth_;
  const std::vector<double> costs_;
  const BlockStructure structure_;
  const std::vector<Eigen::Matrix3d> rig_from_world_;
  const Eigen::Matrix<double, kDim, 3> T_;
  CentredLeastSquares<kDim> least_squares_;
  double mu_ = 0;
  double shortfall_ = 0;
  std::vector<Scaled> scaled_;
  std::vector<Vector> lambda_;
  std::vector<Vector> target_;
  std::vector<BoundVector> rest_;  // S f
  BlockVector gauge_;              // e
  BlockVector x_gauge_;            // H^-1 e
  BlockVector x_target_;
  Direction direction_;
};

}  // namespace krot::internal
