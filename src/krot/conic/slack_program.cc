#include "krot/conic/interior_point.h"

#include <algorithm>
#include <optional>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/conic/path_following.h"
#include "krot/conic/slack_system.h"
#include "krot/minimax/residual_set.h"

namespace krot::internal {
namespace {

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
      solution.price.push_back(
          std::clamp(1 - Cone::Last(now_.z[i]) / costs_[i], 0.0, 1.0));
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
