#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/cones.h"
#include "krot/conic/interior_point.h"

namespace krot::internal {

// What the interior point methods share. Each follows a path of minima of
// barrier problems as their weight mu falls: it factorises Newton's system at
// an iterate, finds a direction and takes a step along it.

// The main loop. `method` offers
//
//   Factorize()         Newton's system at the iterate; false: no factor
//   IsThere()           whether the iterate is what was asked for
//   FindDirection(step) after a step of that length
//   TakeStep()          the length of the step that was taken; 0: none was
//   Recover()           after that, whether another direction may be tried
//   Report(n, step)     after iteration n, the reason to end here, if any
template <typename Method>
InteriorPointTermination FollowPath(const Context& context, int max_iterations,
                                    Method* method, int* num_iterations) {
  using Termination = InteriorPointTermination;
  double step = 1;
  while (*num_iterations < max_iterations) {
    if (context.IsCancelled()) return Termination::kInterrupted;
    if (!method->Factorize()) return Termination::kSingular;
    if (method->IsThere()) return Termination::kConverged;
    method->FindDirection(step);
    step = method->TakeStep();
    if (step == 0) {
      if (method->Recover()) continue;
      return Termination::kNoProgress;
    }
    const auto end = method->Report(++*num_iterations, step);
    if (end) return *end;
  }
  return Termination::kMaxIterations;
}

// Mehrotra's choice of sigma, the share of mu that a direction aims at: the
// cube of the share of the gap that a predictor leaves [Mehrotra 1992], but not
// below `least`.
inline double MehrotraSigma(double share_left, double least) {
  const double left = std::max(0.0, share_left);
  return std::min(1.0, std::max(least, left * left * left));
}

// After a step shorter than this the next one only centres.
inline constexpr double kShortStep = 0.1;

// What rounding may add to a barrier cost, relative.
inline constexpr double kCostRounding = 1e-12;
// Multipliers above this count as active where the weight of a squared error
// is 1.
inline constexpr double kActiveMultiplier = 1e-3;

// The first of the lengths `longest`, 0.7 of it, 0.7 of that, ... for which
// try_step(length) is true; 0 if none is.
template <typename TryStep>
double Backtrack(double longest, const TryStep& try_step) {
  constexpr double kLeastStep = 1e-8;
  for (double step = longest; step >= kLeastStep; step *= 0.7) {
    if (try_step(step)) return step;
  }
  return 0;
}

// The primal-dual method for cone programmes, in a wide neighbourhood of the
// central path:
//
//   FindDirection   one solve each for
//                     a predictor, f = 0               } not after a short
//                     step, a corrector [Mehrotra 1992]      } which only
//                     centres then up to System::kNumCorrectors centrality
//                     correctors [Gondzio 1996]
//   TakeStep        the longest, then shorter ones until one is in the
//                   neighbourhood: trial_ becomes now_
//
// `System` is the Newton system of a programme. It offers the Cone of its pairs
// s_i, z_i; a State with x, viewed, z and gap; Slack(state, i), which is s_i;
// Move and IsPlausible for trials; whether primal and dual steps are of one
// length; and Solve for targets f, which leads to a direction with ds and dz
// scaled so that W z = W^-1 s = lambda().
template <typename System>
class ConePath {
 public:
  using Cone = typename System::Cone;
  using State = typename System::State;
  using Vector = typename Cone::Vector;

  // Sigma after a short step. Scaling or leaving out the corrector instead took
  // more iterations (docs/history/journal.md, "The interior point, variants
  // without effect").
  static constexpr double kCentring = 0.8;

  template <typename... Arguments>
  explicit ConePath(Arguments&&... arguments)
      : system_(std::forward<Arguments>(arguments)...) {}

  bool Recover() { return false; }
  // Returns the shorter of the two step lengths.
  double TakeStep() {
    const StepLengths longest = MaxSteps(kDamping);
    const auto try_share = [&](double share) {
      system_.Move(now_, share * longest.primal, &trial_);
      system_.loop().ForEach([&](int64_t i) {
        trial_.z[i] = now_.z[i] + share * longest.dual * system_.UnscaledDz(i);
      });
      trial_.gap = system_.loop().Sum(
          [&](int64_t i) { return system_.Slack(trial_, i).dot(trial_.z[i]); });
      if (!IsInside(trial_)) return false;
      std::swap(now_, trial_);
      return true;
    };
    return longest.Least() * Backtrack(1, try_share);
  }

 protected:
  // Along ds, and so x, and along dz.
  struct StepLengths {
    double primal = 0;
    double dual = 0;
    double Least() const { return std::min(primal, dual); }
  };

  // Every pair keeps its smallest eigenvalue above this share of their mean. A
  // larger share shortens steps, a smaller one lets the next ones become short.
  static constexpr double kNeighbourhood = 1e-3;
  static constexpr double kLeastSigma = 1e-6;
  // A step goes so far of the way to the boundary.
  static constexpr double kDamping = 0.98;

  // Only centres, with this sigma, or aims at the end.
  // Of lambda o f = sigma mu e.
  void Centre(double sigma) {
    system_.Solve(
        [&](int64_t i) -> Vector {
          return Cone::Divide(system_.lambda()[i],
                              sigma * system_.mu() * Cone::Identity());
        },
        sigma);
    ImproveCentrality(sigma);
  }

  // Of lambda o f = 0, then of lambda o f = sigma mu e - ds o dz of that.
  void PredictAndCorrect() {
    system_.Solve([](int64_t) -> Vector { return Vector::Zero(); }, 0);
    const double sigma = PredictedSigma();
    system_.Solve(
        [&](int64_t i) -> Vector {
          const Vector target = sigma * system_.mu() * Cone::Identity() -
                                Cone::Product(system_.direction().ds[i],
                                              system_.direction().dz[i]);
          return Cone::Divide(system_.lambda()[i], target);
        },
        sigma);
    ImproveCentrality(sigma);
  }

  double MuOf(double gap) const {
    return gap / static_cast<double>(system_.loop().count() * Cone::kDegree);
  }

  System system_;
  State now_, trial_;

 private:
  // `damping` times the steps to the boundary, at most 1.
  StepLengths MaxSteps(double damping) const {
    const auto max_step = [&](const std::vector<Vector>& direction) {
      return damping * system_.loop().Min([&](int64_t i) {
        return Cone::MaxStep(system_.lambda()[i], direction[i], 1 / damping);
      });
    };
    StepLengths steps{max_step(system_.direction().ds),
                      max_step(system_.direction().dz)};
    if (system_.HasOneStep()) steps.primal = steps.dual = steps.Least();
    return steps;
  }

  double PredictedSigma() const {
    StepLengths steps = MaxSteps(1);
    if (!System::kGapAfterOwnSteps) steps.primal = steps.dual = steps.Least();
    const double gap = system_.loop().Sum([&](int64_t i) {
      const Vector& lambda = system_.lambda()[i];
      return (lambda + steps.primal * system_.direction().ds[i])
          .dot(lambda + steps.dual * system_.direction().dz[i]);
    });
    return MehrotraSigma(MuOf(gap) / system_.mu(), kLeastSigma);
  }

  // Centrality correctors, each a solve without a factor. One aims at a step
  // that is longer by kLonger: it adds to lambda o f what the products of the
  // pairs lack there of being within a factor kRange of mu. It is taken back if
  // the step becomes shorter, and one that does not gain kWorthwhile is the
  // last [Colombo, Gondzio 2008]. Two took a fifth of the joint iterations away
  // (docs/history/journal.md).
  void ImproveCentrality(double sigma) {
    if constexpr (System::kNumCorrectors > 0) {
      constexpr double kLonger = 0.3;
      constexpr double kRange = 10;
      constexpr double kWorthwhile = 0.03;
      constexpr double kLongStep = 0.9;  // needs no corrector
      const double mu = sigma * system_.mu();
      for (int n = 0; n < System::kNumCorrectors; ++n) {
        const double before = MaxSteps(kDamping).Least();
        if (before > kLongStep) return;
        const double ahead = std::min(1.0, before + kLonger);
        typename System::Direction direction = system_.direction();
        system_.Solve(
            [&](int64_t i) -> Vector {
              const Vector& lambda = system_.lambda()[i];
              const Vector product =
                  Cone::Product(lambda + ahead * direction.ds[i],
                                lambda + ahead * direction.dz[i]);
              const Vector lacking =
                  Cone::Clamp(product, mu / kRange, mu * kRange) - product;
              return system_.target()[i] +
                     Cone::Divide(lambda, Cone::Clamp(lacking, -mu * kRange,
                                                      mu * kRange));
            },
            sigma);
        const double gain = MaxSteps(kDamping).Least() - before;
        if (gain < 0) system_.Restore(std::move(direction));
        if (gain < kWorthwhile) return;
      }
    }
  }

  bool IsInside(const State& trial) const {
    const double least = kNeighbourhood * MuOf(trial.gap);
    return system_.loop().Min([&](int64_t i) {
      if (!system_.IsPlausible(now_, trial, i)) return -1.0;
      const Vector s = system_.Slack(trial, i);
      if (!(Cone::SmallestEigenvalue(s) > 0) ||
          !(Cone::SmallestEigenvalue(trial.z[i]) > 0)) {
        return -1.0;
      }
      return Cone::SmallestProduct(s, trial.z[i]) - least;
    }) >= 0;
  }
};

}  // namespace krot::internal
