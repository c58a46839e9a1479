#include "krot/conic/interior_point.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/conic/cones.h"
#include "krot/conic/path_following.h"

namespace krot::internal {
namespace {

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
class SlackSystem
    : public ConeSystem<WithHalfLine<BoundCone>, BoundCone::kDim> {
  using Base = ConeSystem<WithHalfLine<BoundCone>, BoundCone::kDim>;

 public:
  using typename Base::Cone, typename Base::Vector, typename Base::Vector3d;
  static constexpr int kNumCorrectors = 0;
  static constexpr bool kGapAfterOwnSteps = true;

  struct State {
    Estimate x;
    std::vector<ViewedPoint> viewed;
    std::vector<double> sigma;
    std::vector<Vector> z;  // (z; zeta)
    double gap = 0;         // sum s'z
  };

  // `costs` are the c_i. Where the scale is free and `start` is given, the
  // gauge is the size of the frames' centres along those of `start`; otherwise,
  // or if these coincide, e'x is the mean of w_i / depths_i.
  SlackSystem(const KnownRotationProblem& problem, Norm norm, double bound,
              std::vector<double> costs, const std::vector<double>& depths,
              double min_depth, const Estimate* start, int num_threads)
      : Base(problem, norm, num_threads),
        has_free_scale_(!HasBaseline(problem)),
        bound_(bound),
        min_depth_(min_depth),
        costs_(std::move(costs)),
        scaled_(problem.observations.size()),
        dsigma_(problem.observations.size()),
        rest_(problem.observations.size()) {
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
    Base::ViewAll(to);
    loop_.ForEach(
        [&](int64_t i) { to->sigma[i] = from.sigma[i] + step * dsigma_[i]; });
  }

  bool IsPlausible(const State&, const State&, int64_t) const { return true; }

  // Factorises at an iterate; false if that fails. Where the scale is free, e'x
  // is to grow by `shortfall`.
  bool Factorize(const State& at, double shortfall) {
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
      Base::SetRows(i, bound_, [&](const BoundVector& of_E) -> BoundVector {
        const BoundVector column = own.W.ApplyInverse(of_E);
        return column - own.kappa * own.b.dot(column) * own.b;
      });
    });
    Base::FindMu();
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

  // The multipliers' direction, with the scaling removed.
  Vector UnscaledDz(int64_t i) const {
    const Scaled& own = scaled_[i];
    const Vector& dz = direction_.dz[i];
    return Cone::Join(own.W.ApplyInverse(Cone::Head(dz)),
                      own.d * Cone::Last(dz));
  }

 private:
  using Base::direction_, Base::gauge_, Base::lambda_, Base::least_squares_,
      Base::loop_, Base::mu_, Base::problem_, Base::rig_from_world_,
      Base::structure_, Base::T_, Base::target_, Base::x_gauge_,
      Base::x_target_;
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
    auto& d = direction_;
    d.dx = x_target_;
    d.dx.Add(-nu, x_gauge_);
    loop_.ForEach([&](int64_t i) {
      const Scaled& own = scaled_[i];
      const BoundVector f = Cone::Head(target_[i]);
      const double g = Cone::Last(target_[i]);
      const BoundVector change = ScaledChange(d.dx, i);
      dsigma_[i] = (own.b.dot(f - change) + own.d * g - costs_[i]) / own.beta;
      d.ds[i] = Cone::Join(change + dsigma_[i] * own.b, own.d * dsigma_[i]);
      d.dz[i] = target_[i] - lambda_[i] - d.ds[i];
    });
  }

  const bool has_free_scale_;
  const double bound_;
  const double min_depth_;
  const std::vector<double> costs_;
  double shortfall_ = 0;
  std::vector<Scaled> scaled_;
  std::vector<double> dsigma_;     // along the last direction
  std::vector<BoundVector> rest_;  // S f
};

// From nothing, this is subtracted from all depths, relative to the mean depth.
constexpr double kMinDepthFromNothing = 0.05;

// The depths at the start, raised to at least a share of their median; empty if
// most are not positive.
std::vector<double> DepthsForCosts(const KnownRotationProblem& problem,
                                   const Estimate& start) {
  std::vector<double> depths;
  for (const Observation& o : problem.observations) {
    depths.push_back(ViewPoint(problem, o, start).depth);
  }
  const double median = Median(depths);
  if (!(median > 0)) return {};
  for (double& depth : depths) {
    depth = std::max(depth, 0.1 * median);
  }
  return depths;
}

std::vector<double> CostsFor(const SlackOptions& options,
                             const std::vector<double>& depths) {
  std::vector<double> costs;
  for (size_t i = 0; i < depths.size(); ++i) {
    costs.push_back((options.weights.empty() ? 1 : options.weights[i]) /
                    depths[i]);
  }
  return costs;
}

template <typename BoundCone>
class SlackSolver : public ConePath<SlackSystem<BoundCone>> {
 public:
  // `depths` are those at the start, or 1 for a start from nothing.
  SlackSolver(const KnownRotationProblem& problem, double bound,
              const SlackOptions& options, const Context& context,
              const Estimate& start, const std::vector<double>& depths,
              bool is_from_nothing)
      : Base(problem, options.norm, bound, CostsFor(options, depths), depths,
             is_from_nothing ? kMinDepthFromNothing : 0,
             is_from_nothing ? nullptr : &start, context.num_threads),
        options_(options),
        context_(context),
        bound_(bound),
        min_depth_(is_from_nothing ? kMinDepthFromNothing : 0),
        depths_(depths),
        costs_(CostsFor(options, depths)) {
    // The first mu is lower for a start from an estimate, where the multipliers
    // are soon stationary.
    Start(start, bound * (is_from_nothing ? 0.5 : 0.15));
    if (!is_from_nothing) size_ = system_.Size(start);
  }

  SlackSolution Run(Estimate* estimate) {
    SlackSolution solution;
    solution.termination = FollowPath(context_, options_.max_iterations, this,
                                      &solution.iterations);
    *estimate = now_.x;
    for (size_t i = 0; i < costs_.size(); ++i) {
      solution.slack.push_back(now_.sigma[i] / depths_[i]);
    }
    return solution;
  }

  // What FollowPath calls.
  bool Factorize() {
    return system_.Factorize(now_, size_ - system_.Size(now_.x));
  }
  bool IsThere() const { return system_.mu() <= options_.smallest_mu * bound_; }
  void FindDirection(double step) {
    if (step < kShortStep) return Base::Centre(Base::kCentring);
    Base::PredictAndCorrect();
  }
  std::optional<InteriorPointTermination> Report(int, double) {
    return std::nullopt;
  }

 private:
  using Base = ConePath<SlackSystem<BoundCone>>;
  using Cone = typename Base::Cone;
  using Base::now_;
  using Base::system_;
  using Base::trial_;

  // The sigma at which the centred multipliers of both pairs add up to the
  // cost,
  //
  //   mu (q's^-1 + 1 / sigma) = c_i.
  //
  // The left side is convex and falls with sigma, so Newton's method converges
  // from below.
  double CentredSigma(const ViewedPoint& viewed, double cost, double mu) const {
    const double least =
        std::max(0.0, NormOf(viewed.v, options_.norm) -
                          bound_ * (viewed.depth - min_depth_));
    double sigma = least + 0.5 * mu / cost;
    for (int n = 0; n < 8; ++n) {
      const typename BoundCone::Vector inverse = BoundCone::Divide(
          system_.BoundSlack(viewed, sigma), BoundCone::Identity());
      const double value =
          mu * (system_.Multiplier(inverse) + 1 / sigma) - cost;
      const double slope =
          -mu * (system_.Multiplier(BoundCone::Product(inverse, inverse)) +
                 1 / (sigma * sigma));
      sigma -= value / slope;
    }
    return sigma;
  }

  // Sets a perfectly centred start, z = mu s^-1 and zeta = mu / sigma.
  void Start(const Estimate& start, double mu) {
    now_.x = start;
    now_.sigma.resize(costs_.size());
    now_.z.resize(costs_.size());
    system_.ViewAll(&now_);
    system_.loop().ForEach([&](int64_t i) {
      now_.sigma[i] = CentredSigma(now_.viewed[i], costs_[i], mu);
      now_.z[i] = mu * Cone::Divide(system_.Slack(now_, i), Cone::Identity());
    });
    trial_ = now_;
  }

  const SlackOptions options_;
  const Context context_;
  const double bound_;
  const double min_depth_;
  const std::vector<double>& depths_;
  const std::vector<double> costs_;
  double size_ = 1;  // the value at which e'x is held
};

}  // namespace

SlackSolution MinimizeSlack(const KnownRotationProblem& problem, double bound,
                            const SlackOptions& options, const Context& context,
                            Estimate* estimate) {
  CheckConic(options.norm);
  CheckPositive(bound, "bound");
  CheckPositive(options.smallest_mu, "smallest_mu");
  CheckArgument(options.weights.empty() ||
                    options.weights.size() == problem.observations.size(),
                "weights.size()", options.weights.size(),
                "0 or the number of observations");
  std::vector<double> depths = DepthsForCosts(problem, *estimate);
  const bool is_from_nothing = depths.empty();
  if (is_from_nothing) {
    depths.assign(problem.observations.size(), 1);
    estimate->translations.assign(problem.num_frames, Eigen::Vector3d::Zero());
    estimate->points.assign(problem.num_points, Eigen::Vector3d::Zero());
  }
  const auto solve = [&](auto cone) {
    return SlackSolver<decltype(cone)>(problem, bound, options, context,
                                       *estimate, depths, is_from_nothing)
        .Run(estimate);
  };
  return options.norm.p == 2 ? solve(SecondOrderCone())
                             : solve(FourHalfLines());
}

}  // namespace krot::internal
