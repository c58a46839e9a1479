#include "krot/conic/excess_solver.h"

#include <cmath>
#include <utility>

#include "krot/minimax/residual.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

// Of the mean depth.
constexpr double kMinDepthFromNothing = 0.05;
// Where mu starts, of b. From an estimate it is the lower one: its forces soon
// balance.
constexpr double kExcessMuFromNothing = 0.5;
constexpr double kExcessMu = 0.15;
constexpr int kExcessSigmaSteps = 8;
constexpr double kExcessDamping = 0.98;
constexpr double kExcessNeighbourhood = 1e-3;
constexpr double kExcessBacktracking = 0.7;
constexpr double kSmallestExcessStep = 1e-8;
constexpr double kShortExcessStep = 0.1;
constexpr double kExcessCentring = 0.8;
constexpr double kSmallestExcessSigma = 1e-6;

}  // namespace

template <typename Cone>
ExcessSolver<Cone>::ExcessSolver(const KnownRotationProblem& problem,
                                 double bound, const ExcessOptions& options,
                                 const Context& context, const Estimate& start,
                                 const std::vector<double>& depths,
                                 bool has_depths)
    : problem_(problem),
      options_(options),
      context_(context),
      bound_(bound),
      depths_(depths),
      costs_(CostsOf(options, depths)),
      min_depth_(has_depths ? 0 : kMinDepthFromNothing),
      system_(problem, options.norm, bound, costs_, depths, min_depth_,
              has_depths ? &start : nullptr, context.num_threads) {
  Start(start);
  size_ = has_depths ? system_.Size(start) : 1;
}

template <typename Cone>
void ExcessSolver<Cone>::ViewAll(Iterate* iterate) const {
  system_.loop().ForEach([&](int64_t i) {
    iterate->viewed[i] =
        ViewPoint(problem_, problem_.observations[i], iterate->x);
  });
}

// Where the multipliers of both pairs, centred, add up to the cost,
//
//   mu (q's^-1 + 1 / sigma) = c_i,
//
// whose left side is convex and falls: Newton's method, from below.
template <typename Cone>
double ExcessSolver<Cone>::CentredSigma(const ViewedPoint& viewed, double cost,
                                        double mu) const {
  const double least = std::max(0.0, NormOf(viewed.v, options_.norm) -
                                         bound_ * (viewed.depth - min_depth_));
  double sigma = least + 0.5 * mu / cost;
  for (int n = 0; n < kExcessSigmaSteps; ++n) {
    const Vector inverse =
        Cone::Divide(system_.Slack(viewed, sigma), Cone::Identity());
    const double value = mu * (system_.Multiplier(inverse) + 1 / sigma) - cost;
    const double slope =
        -mu * (system_.Multiplier(Cone::Product(inverse, inverse)) +
               1 / (sigma * sigma));
    sigma -= value / slope;
  }
  return sigma;
}

// Centred, z = mu s^-1 and zeta = mu / sigma, whatever the weights.
template <typename Cone>
void ExcessSolver<Cone>::Start(const Estimate& start) {
  const size_t count = problem_.observations.size();
  now_.x = start;
  now_.viewed.resize(count);
  now_.sigma.resize(count);
  now_.zeta.resize(count);
  now_.z.resize(count);
  ViewAll(&now_);
  const double mu =
      bound_ * (min_depth_ > 0 ? kExcessMuFromNothing : kExcessMu);
  system_.loop().ForEach([&](int64_t i) {
    const ViewedPoint& viewed = now_.viewed[i];
    now_.sigma[i] = CentredSigma(viewed, costs_[i], mu);
    now_.zeta[i] = mu / now_.sigma[i];
    now_.z[i] = mu * Cone::Divide(system_.Slack(viewed, now_.sigma[i]),
                                  Cone::Identity());
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
    if (!system_.Factorize(now_, size_ - system_.Size(now_.x))) {
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

template class ExcessSolver<SecondOrderCone>;
template class ExcessSolver<FourHalfLines>;

}  // namespace krot
