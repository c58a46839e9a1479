#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/conic/cones.h"
#include "krot/conic/interior_point.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"

namespace krot::internal {

// The common part of the interior point methods. Each follows the minima of
// barrier problems as their weight mu falls: it factorises Newton's system at
// an iterate, finds a direction and takes a step along it.

// The main loop. `method` offers
//
//   Factorize()         factorises Newton's system at the iterate; false if
//                       that fails
//   IsThere()           whether the iterate has converged
//   FindDirection(step) finds a direction; `step` is the last step's length
//   TakeStep()          takes a step, returns its length; 0 if none is possible
//   Recover()           called after a step of 0: whether to try once more
//   Report(n, step)     called after iteration n: the reason to end, if any
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

// Mehrotra's choice of sigma, which makes sigma mu the target of a direction:
// the cube of the share of the gap that a predictor leaves [Mehrotra 1992],
// within `least` and 1.
inline double MehrotraSigma(double share_left, double least) {
  const double left = std::max(0.0, share_left);
  return std::min(1.0, std::max(least, left * left * left));
}

// After a step shorter than this, the next direction only centres.
inline constexpr double kShortStep = 0.1;

// Rounding may raise a barrier cost by this, relative.
inline constexpr double kCostRounding = 1e-12;
// Multipliers above this count as active, in programmes where squared errors
// have the weight 1.
inline constexpr double kActiveMultiplier = 1e-3;

// The first of the lengths `longest`, 0.7 of it, 0.7 of that, ... for which
// try_step(length) is true; 0 if none is.
template <typename TryStep>
double Backtrack(double longest, const TryStep& try_step) {
  for (double step = longest; step >= 1e-8; step *= 0.7) {
    if (try_step(step)) return step;
  }
  return 0;
}

// What the Newton systems of cone programmes have in common. Each observation
// has a pair s_i, z_i in the cone, scaled by W_i so that lambda_i = W_i z_i =
// W_i^-1 s_i, and kRows rows of the normal equations. A direction is found for
// targets f_i. x stands for points and for the frames' centres in the world.
template <typename ConeType, int kRows>
class ConeSystem {
 public:
  using Cone = ConeType;
  using Vector = typename Cone::Vector;
  using Vector3d = Eigen::Vector3d;

  // ds and dz are scaled by W.
  struct Direction {
    BlockVector dx;
    double dscalar = 0;  // of a programme's further unknown
    std::vector<Vector> ds, dz;
  };

  // Sets state->viewed, the depth and v of every observation, from x.
  template <typename State>
  void ViewAll(State* state) const {
    state->viewed.resize(problem_.observations.size());
    loop_.ForEach([&](int64_t i) {
      state->viewed[i] =
          ViewPoint(problem_, problem_.observations[i], state->x);
    });
  }

  const ObservationLoop& loop() const { return loop_; }
  double mu() const { return mu_; }  // mean of s'z per degree of the cones
  const std::vector<Vector>& lambda() const { return lambda_; }
  const std::vector<Vector>& target() const { return target_; }  // the last f
  const Direction& direction() const { return direction_; }      // for that

 protected:
  ConeSystem(const KnownRotationProblem& problem, Norm norm, int num_threads)
      : problem_(problem),
        loop_(SignedSize(problem.observations), num_threads),
        structure_(AnchoredStructure(problem)),
        rig_from_world_(RigFromWorldRotations(problem)),
        T_(ConeMap<kRows>(norm)),
        least_squares_(structure_, {num_threads}),
        lambda_(problem.observations.size()),
        target_(problem.observations.size()) {
    direction_.ds.resize(problem.observations.size());
    direction_.dz.resize(problem.observations.size());
  }

  // Sets the rows of observation i: row_of(column) for each column of T E,
  // whose depth has the factor `top_per_depth`.
  template <typename RowOf>
  void SetRows(int64_t i, double top_per_depth, const RowOf& row_of) {
    using Rows = Eigen::Matrix<double, kRows, 3, Eigen::RowMajor>;
    const Observation& o = problem_.observations[i];
    Eigen::Matrix3d E = o.E;
    E.row(0) *= top_per_depth;
    Rows rows;  // of x_cam
    for (int c = 0; c < 3; ++c) rows.col(c) = row_of(T_ * E.col(c));
    Eigen::Map<Rows>(least_squares_.rows(i)).noalias() =
        rows * problem_.views[o.view].cam_from_world_rotation;
  }
  // Once lambda_ is set.
  void FindMu() {
    mu_ = loop_.Sum([&](int64_t i) { return lambda_[i].squaredNorm(); }) /
          static_cast<double>(loop_.count() * Cone::kDegree);
  }

  const KnownRotationProblem& problem_;
  const ObservationLoop loop_;
  const BlockStructure structure_;
  const std::vector<Eigen::Matrix3d> rig_from_world_;
  const Eigen::Matrix<double, kRows, 3> T_;
  CentredLeastSquares<kRows> least_squares_;
  double mu_ = 0;
  std::vector<Vector> lambda_;
  std::vector<Vector> target_;
  Direction direction_;
  BlockVector gauge_;     // e
  BlockVector x_gauge_;   // H^-1 e
  BlockVector x_target_;  // H^-1 of the right-hand side of the targets
};

// The primal-dual method for cone programmes, in a wide neighbourhood of the
// central path:
//
//   FindDirection   a predictor, f = 0, and a corrector [Mehrotra 1992]; or,
//                   after a short step, centring only. Then up to
//                   System::kNumCorrectors centrality correctors [Gondzio
//                   1996]. Each takes one solve.
//   TakeStep        tries the longest step, then shorter ones, until one is in
//                   the neighbourhood: trial_ becomes now_
//
// `System` is the ConeSystem of a programme. It offers a State with x, viewed,
// z and gap; Slack(state, i), which is s_i; Move and IsPlausible for trials;
// HasOneStep, whether primal and dual steps must have the same length; and
// Solve for targets f, which finds a direction.
template <typename System>
class ConePath {
 public:
  using Cone = typename System::Cone;
  using State = typename System::State;
  using Vector = typename Cone::Vector;

  // Sigma after a short step. Scaling or leaving out the corrector instead
  // takes more iterations (docs/history/journal.md, "The interior point,
  // variants without effect").
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
  // Primal: of ds, and so of x. Dual: of dz.
  struct StepLengths {
    double primal = 0;
    double dual = 0;
    double Least() const { return std::min(primal, dual); }
  };

  // Fraction to the boundary of a step.
  static constexpr double kDamping = 0.98;

  // Finds a direction that only centres, for lambda o f = sigma mu e.
  void Centre(double sigma) {
    system_.Solve(
        [&](int64_t i) -> Vector {
          return Cone::Divide(system_.lambda()[i],
                              sigma * system_.mu() * Cone::Identity());
        },
        sigma);
    ImproveCentrality(sigma);
  }

  // Solves for the predictor, f = 0, then for the corrector with
  // lambda o f = sigma mu e - ds o dz, where ds and dz are the predictor's.
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
  // `damping` times the step lengths to the boundary, at most 1.
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
    return MehrotraSigma(MuOf(gap) / system_.mu(), 1e-6);
  }

  // Centrality correctors; each is one solve with the same factor. A corrector
  // aims at a step that is longer by 0.3: it corrects lambda o f so that there
  // the products of the pairs are within a factor kRange of mu. It is undone if
  // the step becomes shorter, and the last one if the step grows by next to
  // nothing [Colombo, Gondzio 2008]. Two of them save a fifth of the joint
  // iterations (docs/history/journal.md).
  void ImproveCentrality(double sigma) {
    if constexpr (System::kNumCorrectors > 0) {
      constexpr double kRange = 10;
      const double mu = sigma * system_.mu();
      for (int n = 0; n < System::kNumCorrectors; ++n) {
        const double before = MaxSteps(kDamping).Least();
        if (before > 0.9) return;  // a long step needs no corrector
        const double ahead = std::min(1.0, before + 0.3);
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
        if (gain < 0.03) return;
      }
    }
  }

  // Whether the square of the smallest eigenvalue of every scaled pair is above
  // a share of mu. A larger share would shorten steps; a smaller one would make
  // the steps after it short.
  bool IsInside(const State& trial) const {
    const double least = 1e-3 * MuOf(trial.gap);
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
