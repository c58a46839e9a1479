#include "krot/conic/excess_program.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/check.h"
#include "krot/conic/excess_system.h"
#include "krot/minimax/residual.h"

namespace krot {
namespace {

// Smaller depths than this share of the median count as much in the costs.
constexpr double kSmallestDepthInCosts = 0.1;
// sigma starts this far, of b and the depth, above what it must be.
constexpr double kExcessMargin = 0.5;
constexpr double kExcessDamping = 0.98;
constexpr double kExcessNeighbourhood = 1e-3;
constexpr double kExcessBacktracking = 0.7;
constexpr double kSmallestExcessStep = 1e-8;
constexpr double kShortExcessStep = 0.1;
constexpr double kExcessCentring = 0.8;
constexpr double kSmallestExcessSigma = 1e-6;

// The depths at the start, those that are not positive or small raised; all 1
// if most are not positive.
std::vector<double> DepthsForCosts(const KnownRotationProblem& problem,
                                   const Estimate& start, bool* has_depths) {
  std::vector<double> depths;
  depths.reserve(problem.observations.size());
  for (const Observation& o : problem.observations) {
    depths.push_back(ViewPoint(problem, o, start).depth);
  }
  std::vector<double> sorted = depths;
  const auto middle =
      sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  *has_depths = *middle > 0;
  for (double& depth : depths) {
    depth = *has_depths ? std::max(depth, kSmallestDepthInCosts * *middle) : 1;
  }
  return depths;
}

// One run of the interior point, as in conic_solver.h.
template <typename Cone>
class ExcessSolver {
 public:
  ExcessSolver(const KnownRotationProblem& problem, double bound,
               const ExcessOptions& options, const Context& context,
               const Estimate& start, const std::vector<double>& depths,
               bool has_depths)
      : problem_(problem),
        options_(options),
        context_(context),
        bound_(bound),
        depths_(depths),
        costs_(CostsOf(options, depths)),
        system_(problem, options.norm, bound, costs_, depths,
                context.num_threads) {
    Start(start);
    mean_depth_ = has_depths ? system_.MeanDepth(start) : 1;
  }

  ExcessSolution Run(Estimate* estimate);

 private:
  using Vector = typename Cone::Vector;
  using Iterate = typename ExcessSystem<Cone>::Iterate;
  using Target = typename ExcessSystem<Cone>::Target;

  struct Steps {
    double primal = 1;
    double dual = 1;
    double Least() const { return std::min(primal, dual); }
  };

  static std::vector<double> CostsOf(const ExcessOptions& options,
                                     const std::vector<double>& depths) {
    std::vector<double> costs(depths.size());
    for (size_t i = 0; i < costs.size(); ++i) {
      const double weight = options.weights.empty() ? 1 : options.weights[i];
      costs[i] = weight / depths[i];
    }
    return costs;
  }

  void Start(const Estimate& start);
  void ViewAll(Iterate* iterate) const;
  Steps MaxSteps(double damping) const;
  double AffineSigma() const;
  void FindDirection(bool only_centre);
  bool IsInside(const Iterate& trial) const;
  double TakeStep();

  const KnownRotationProblem& problem_;
  const ExcessOptions& options_;
  const Context& context_;
  const double bound_;
  const std::vector<double>& depths_;
  const std::vector<double> costs_;
  ExcessSystem<Cone> system_;
  double mean_depth_ = 1;
  Iterate now_, trial_;
};

template <typename Cone>
void ExcessSolver<Cone>::ViewAll(Iterate* iterate) const {
  system_.loop().ForEach([&](int64_t i) {
    iterate->viewed[i] =
        ViewPoint(problem_, problem_.observations[i], iterate->x);
  });
}

// Centred: z = mu s^-1, zeta = mu / sigma.
template <typename Cone>
void ExcessSolver<Cone>::Start(const Estimate& start) {
  const size_t count = problem_.observations.size();
  now_.x = start;
  now_.viewed.resize(count);
  now_.sigma.resize(count);
  now_.zeta.resize(count);
  now_.z.resize(count);
  ViewAll(&now_);
  const double mu = bound_ * kExcessMargin;
  system_.loop().ForEach([&](int64_t i) {
    const ViewedPoint& viewed = now_.viewed[i];
    const double unit = kExcessMargin * bound_ * depths_[i];
    const double weight = costs_[i] * depths_[i];
    now_.sigma[i] = unit + std::max(0.0, NormOf(viewed.v, options_.norm) -
                                             bound_ * viewed.depth);
    now_.zeta[i] = weight * mu / now_.sigma[i];
    now_.z[i] =
        weight * mu *
        Cone::Divide(system_.Slack(viewed, now_.sigma[i]), Cone::Identity());
  });
  trial_ = now_;
}

template <typename Cone>
typename ExcessSolver<Cone>::Steps ExcessSolver<Cone>::MaxSteps(
    double damping) const {
  const auto& direction = system_.direction();
  const auto max_step = [&](const std::vector<Vector>& cone,
                            const std::vector<double>& linear) {
    return damping * system_.loop().Min([&](int64_t i) {
      double step = Cone::MaxStep(system_.lambda(i), cone[i], 1 / damping);
      if (linear[i] < 0) {
        step = std::min(step, -system_.linear_lambda(i) / linear[i]);
      }
      return step;
    });
  };
  return {max_step(direction.ds, direction.dsigma),
          max_step(direction.dz, direction.dzeta)};
}

template <typename Cone>
double ExcessSolver<Cone>::AffineSigma() const {
  const Steps steps = MaxSteps(1);
  const auto& d = system_.direction();
  const double gap = system_.loop().Sum([&](int64_t i) {
    return (system_.lambda(i) + steps.primal * d.ds[i])
               .dot(system_.lambda(i) + steps.dual * d.dz[i]) +
           (system_.linear_lambda(i) + steps.primal * d.dsigma[i]) *
               (system_.linear_lambda(i) + steps.dual * d.dzeta[i]);
  });
  const double pairs =
      static_cast<double>(system_.loop().count() * (Cone::kDegree + 1));
  const double left = std::max(0.0, gap / (system_.mu() * pairs));
  return std::clamp(left * left * left, kSmallestExcessSigma, 1.0);
}

// Predictor and corrector [Mehrotra 1992].
template <typename Cone>
void ExcessSolver<Cone>::FindDirection(bool only_centre) {
  double sigma = kExcessCentring;
  if (!only_centre) {
    system_.Solve([](int64_t) { return Target(); }, 0);
    sigma = AffineSigma();
  }
  const double mu = sigma * system_.mu();
  system_.Solve(
      [&](int64_t i) {
        Vector product = mu * Cone::Identity();
        double linear_product = mu;
        if (!only_centre) {
          const auto& d = system_.direction();
          product -= Cone::Product(d.ds[i], d.dz[i]);
          linear_product -= d.dsigma[i] * d.dzeta[i];
        }
        return Target{Cone::Divide(system_.lambda(i), product),
                      linear_product / system_.linear_lambda(i)};
      },
      sigma);
}

template <typename Cone>
bool ExcessSolver<Cone>::IsInside(const Iterate& trial) const {
  const double sum = system_.loop().Sum([&](int64_t i) {
    return system_.Slack(trial.viewed[i], trial.sigma[i]).dot(trial.z[i]) +
           trial.sigma[i] * trial.zeta[i];
  });
  const double smallest =
      kExcessNeighbourhood * sum /
      static_cast<double>(system_.loop().count() * (Cone::kDegree + 1));
  return system_.loop().Min([&](int64_t i) {
    const Vector s = system_.Slack(trial.viewed[i], trial.sigma[i]);
    if (!(Cone::SmallestEigenvalue(s) > 0) || !(trial.sigma[i] > 0) ||
        !(Cone::SmallestEigenvalue(trial.z[i]) > 0) || !(trial.zeta[i] > 0)) {
      return -1.0;
    }
    return std::min(Cone::SmallestProduct(s, trial.z[i]),
                    trial.sigma[i] * trial.zeta[i]) -
           smallest;
  }) >= 0;
}

// The shorter of the steps taken; 0 if there is none.
template <typename Cone>
double ExcessSolver<Cone>::TakeStep() {
  const BlockVector& dx = system_.direction().dx;
  for (Steps step = MaxSteps(kExcessDamping);
       step.Least() >= kSmallestExcessStep;
       step.primal *= kExcessBacktracking, step.dual *= kExcessBacktracking) {
    for (size_t k = 0; k < dx.points.size(); ++k) {
      trial_.x.points[k] = now_.x.points[k] + step.primal * dx.points[k];
    }
    for (size_t f = 0; f < dx.frames.size(); ++f) {
      trial_.x.translations[f] =
          now_.x.translations[f] + step.primal * dx.frames[f];
    }
    ViewAll(&trial_);
    system_.loop().ForEach([&](int64_t i) {
      trial_.sigma[i] = now_.sigma[i] + step.primal * system_.UnscaledDsigma(i);
      trial_.z[i] = now_.z[i] + step.dual * system_.UnscaledDz(i);
      trial_.zeta[i] = now_.zeta[i] + step.dual * system_.UnscaledDzeta(i);
    });
    if (IsInside(trial_)) {
      std::swap(now_, trial_);
      return step.Least();
    }
  }
  return 0;
}

template <typename Cone>
ExcessSolution ExcessSolver<Cone>::Run(Estimate* estimate) {
  using Termination = InteriorPointTermination;
  ExcessSolution solution;
  solution.termination = Termination::kMaxIterations;
  double step = 1;
  while (solution.iterations < options_.max_iterations) {
    if (context_.IsCancelled()) {
      solution.termination = Termination::kInterrupted;
      break;
    }
    if (!system_.Factorize(now_, mean_depth_ - system_.MeanDepth(now_.x))) {
      solution.termination = Termination::kSingular;
      break;
    }
    if (system_.mu() <= options_.smallest_mu * bound_) {
      solution.termination = Termination::kSmallestGap;
      break;
    }
    FindDirection(/*only_centre=*/step < kShortExcessStep);
    step = TakeStep();
    ++solution.iterations;
    if (!(step > 0)) {
      solution.termination = Termination::kNoProgress;
      break;
    }
  }
  *estimate = now_.x;
  for (size_t i = 0; i < costs_.size(); ++i) {
    solution.excess.push_back(now_.sigma[i] / depths_[i]);
    solution.price.push_back(
        std::clamp(1 - now_.zeta[i] / costs_[i], 0.0, 1.0));
  }
  return solution;
}

}  // namespace

ExcessSolution MinimizeExcess(const KnownRotationProblem& problem, double bound,
                              const ExcessOptions& options,
                              const Context& context, Estimate* estimate) {
  CheckArgument(options.norm.p == 2 || options.norm.IsPolyhedral(), "norm.p",
                options.norm.p, "1, 2 or infinity");
  CheckArgument(bound > 0, "bound", bound, "> 0");
  CheckArgument(options.smallest_mu > 0, "smallest_mu", options.smallest_mu,
                "> 0");
  CheckArgument(options.weights.empty() ||
                    options.weights.size() == problem.observations.size(),
                "weights.size()", options.weights.size(),
                "0 or the number of observations");
  bool has_depths = false;
  const std::vector<double> depths =
      DepthsForCosts(problem, *estimate, &has_depths);
  if (!has_depths) {
    for (Eigen::Vector3d& t : estimate->translations) t.setZero();
    for (Eigen::Vector3d& s : estimate->points) s.setZero();
  }
  if (options.norm.p == 2) {
    return ExcessSolver<SecondOrderCone>(problem, bound, options, context,
                                         *estimate, depths, has_depths)
        .Run(estimate);
  }
  return ExcessSolver<FourHalfLines>(problem, bound, options, context,
                                     *estimate, depths, has_depths)
      .Run(estimate);
}

}  // namespace krot
