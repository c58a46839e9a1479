#include "krot/conic/conic_solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/conic/centrality.h"
#include "krot/conic/start_multipliers.h"

namespace krot {
namespace {

// Every pair keeps its smallest eigenvalue above this share of their mean. A
// larger one shortens steps, a smaller one lets the next ones become short.
constexpr double kNeighbourhood = 1e-3;
// No depth that is not small grows by more than this factor in a step: far
// beyond, neither the gauge nor the linearised top = g w holds.
constexpr double kMaxDepthGrowth = 3;
// After a step shorter than this, the next one only centres, so far. Scaling
// or leaving out the corrector instead took more iterations
// (docs/history/journal.md, "The interior point, variants without effect").
constexpr double kShortStep = 0.1;
constexpr double kCentring = 0.8;
// Mehrotra's sigma is no less, whatever the predictor leaves of the gap.
constexpr double kSmallestSigma = 1e-6;
// A step goes so far of the way to the boundary, and so far of a step that
// left the neighbourhood; one shorter than the last is none.
constexpr double kDamping = 0.98;
constexpr double kBacktracking = 0.7;
constexpr double kSmallestStep = 1e-8;
// Linear programme: mu at the start, beside ObjectiveLength; how much longer a
// change that balances the multipliers could be, and one that is small.
constexpr double kMuPerLength = 2;
constexpr double kBalancingRoom = 1.25;
constexpr double kSmallChange = 1e3;

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
                               const Context& context,
                               const ConeProgram& program,
                               const Estimate& start, double scalar)
    : problem_(problem),
      options_(options),
      context_(context),
      program_(program),
      system_(problem, program, options.norm, context.num_threads),
      best_(start),
      multipliers_(problem.observations.size()) {
  now_.x = start;
  now_.scalar = start_ = scalar;
  now_.viewed.resize(problem.observations.size());
  now_.z.resize(problem.observations.size());
  trial_ = now_;
  ViewAll(&now_);
  FindStartMultipliers();
  best_cost_ = program_.IsLinear() ? scalar : now_.cost;
}

template <typename Cone>
void ConicSolver<Cone>::ViewAll(State* state) const {
  system_.loop().ForEach([&](int64_t i) {
    state->viewed[i] = ViewPoint(problem_, problem_.observations[i], state->x);
  });
  state->cost = -system_.loop().Min(
      [&](int64_t i) { return -ResidualOf(state->viewed[i], options_.norm); });
}

// Centred, and scaled so that the row of g holds; likewise near known ones; or,
// in the linear programme, so that from the middle of the cones they are soon
// balanced.
template <typename Cone>
void ConicSolver<Cone>::FindStartMultipliers() {
  CentreMultipliers(system_, now_.viewed, now_.scalar, &now_.z);
  if (program_.IsLinear()) {
    if (!Factorize()) return;
    const double mu = kMuPerLength * system_.ObjectiveLength();
    system_.loop().ForEach([&](int64_t i) { now_.z[i] *= mu; });
    return;
  }
  ScaleMultipliers(system_, program_, now_.viewed, &now_.z);
  if (options_.known_multipliers != nullptr && program_.IsCost()) {
    JoinKnownMultipliers(system_, options_.norm, now_.viewed,
                         *options_.known_multipliers, options_.start_margin,
                         &now_.z);
  }
}

// The predictor's f is 0; the corrector's has lambda o f = sigma mu e - ds o
// dz of the predictor.
template <typename Cone>
void ConicSolver<Cone>::FindDirection(bool only_centre) {
  double sigma = program_.IsLinear() && !is_balanced_ ? 1 : kCentring;
  if (!only_centre) {
    system_.Solve([](int64_t) -> Vector { return Vector::Zero(); }, 0);
    sigma = AffineSigma();
  }
  system_.Solve(
      [&](int64_t i) -> Vector {
        Vector target = sigma * system_.mu() * Cone::Identity();
        if (!only_centre) {
          target -= Cone::Product(system_.direction().ds[i],
                                  system_.direction().dz[i]);
        }
        return Cone::Divide(system_.lambda()[i], target);
      },
      sigma);
  ImproveCentrality<Cone>(
      sigma * system_.mu(), sigma, [&] { return MaxSteps(kDamping).Least(); },
      &system_);
}

// Mehrotra's choice: the cube of what the predictor leaves of the gap.
template <typename Cone>
double ConicSolver<Cone>::AffineSigma() const {
  const double step = MaxSteps(1).Least();
  const double gap = system_.loop().Sum([&](int64_t i) {
    const Vector& lambda = system_.lambda()[i];
    return (lambda + step * system_.direction().ds[i])
        .dot(lambda + step * system_.direction().dz[i]);
  });
  const double left = std::max(0.0, gap / system_.gap());
  return std::min(1.0, std::max(kSmallestSigma, left * left * left));
}

// `damping` times the steps to the boundary, at most 1. Stationarity of the
// cost programme holds for one g, and so the two go together there.
template <typename Cone>
typename ConicSolver<Cone>::StepLengths ConicSolver<Cone>::MaxSteps(
    double damping) const {
  const auto max_step = [&](const std::vector<Vector>& direction) {
    return damping * system_.loop().Min([&](int64_t i) {
      return Cone::MaxStep(system_.lambda()[i], direction[i], 1 / damping);
    });
  };
  StepLengths steps{max_step(system_.direction().ds),
                    max_step(system_.direction().dz)};
  if (program_.IsCost()) steps.primal = steps.dual = steps.Least();
  return steps;
}

template <typename Cone>
bool ConicSolver<Cone>::IsInside(const State& trial) const {
  if (!(trial.scalar > 0) && program_.IsCost()) return false;
  const double mu =
      trial.gap / static_cast<double>(system_.loop().count() * Cone::kDegree);
  return system_.loop().Min([&](int64_t i) {
    const ViewedPoint& viewed = trial.viewed[i];
    const Vector s = system_.Slack(viewed, trial.scalar);
    if (program_.IsCost() &&
        (!(viewed.depth > 0) ||
         viewed.depth > kMaxDepthGrowth * std::max(now_.viewed[i].depth,
                                                   system_.small_depth()))) {
      return -1.0;
    }
    if (!(Cone::SmallestEigenvalue(s) > 0) ||
        !(Cone::SmallestEigenvalue(trial.z[i]) > 0)) {
      return -1.0;
    }
    return Cone::SmallestProduct(s, trial.z[i]) - kNeighbourhood * mu;
  }) >= 0;
}

// The longest tried steps that stay in the neighbourhood of the path, the
// shorter of the two; 0 if none do.
template <typename Cone>
double ConicSolver<Cone>::TakeStep() {
  for (StepLengths step = MaxSteps(kDamping); step.Least() >= kSmallestStep;
       step.primal *= kBacktracking, step.dual *= kBacktracking) {
    trial_.x = now_.x;
    Move(system_.direction().dx, step.primal, &trial_.x);
    trial_.scalar = now_.scalar + step.primal * system_.direction().dscalar;
    ViewAll(&trial_);
    system_.loop().ForEach([&](int64_t i) {
      trial_.z[i] = now_.z[i] + step.dual * system_.UnscaledDz(i);
    });
    trial_.gap = system_.loop().Sum([&](int64_t i) {
      return system_.Slack(trial_.viewed[i], trial_.scalar).dot(trial_.z[i]);
    });
    if (IsInside(trial_)) {
      std::swap(now_, trial_);
      return step.Least();
    }
  }
  return 0;
}

template <typename Cone>
void ConicSolver<Cone>::ExportMultipliers() {
  system_.loop().ForEach([&](int64_t i) {
    const Eigen::Vector3d z = system_.ToMultiplier(now_.z[i]);
    multipliers_[i] = {z[0], z.tail<2>()};
  });
}

// Factorises at the iterate. The linear programme's multipliers take the least
// change, in the scaling, that balances them, if that stays well inside of the
// cones; the second one is for what rounding left.
template <typename Cone>
bool ConicSolver<Cone>::FactorizeBalanced() {
  if (!Factorize()) return false;
  for (int change = 0; change < 2; ++change) {
    system_.SolveForBalance(now_.z);
    const double room = system_.loop().Min([&](int64_t i) {
      return Cone::MaxStep(system_.lambda()[i], system_.direction().dz[i],
                           kSmallChange);
    });
    const bool is_inside = room >= kBalancingRoom;
    if (change == 0) is_balanced_ = is_inside;
    if (!is_inside) return true;
    system_.loop().ForEach(
        [&](int64_t i) { now_.z[i] += system_.UnscaledDz(i); });
    if (room < kSmallChange && !Factorize()) return false;
  }
  return true;
}

// The linear programme's is relative to the way from the start to the dual's.
template <typename Cone>
double ConicSolver<Cone>::RelativeGap() const {
  if (!program_.IsLinear()) return now_.gap / now_.scalar;
  return now_.gap / std::max(now_.gap, start_ - now_.scalar + now_.gap);
}

// Why the run ends with this iteration, if it does.
template <typename Cone>
std::optional<InteriorPointTermination> ConicSolver<Cone>::Iterate(
    InteriorPointSummary* summary) {
  using Termination = InteriorPointTermination;
  if (context_.IsCancelled()) return Termination::kInterrupted;
  if (!is_factorized_ && !Factorize()) return Termination::kSingular;
  FindDirection(/*only_centre=*/step_ < kShortStep ||
                (program_.IsLinear() && !is_balanced_));
  step_ = TakeStep();
  ++summary->iterations;
  if (!(step_ > 0)) return Termination::kNoProgress;
  if (program_.IsLinear()) {
    if (!FactorizeBalanced()) return Termination::kSingular;
    is_factorized_ = true;
  }
  ExportMultipliers();
  summary->gamma = now_.scalar;
  summary->gap = RelativeGap();
  const double reached = program_.IsLinear() ? now_.scalar : now_.cost;
  if (reached < best_cost_) {
    best_cost_ = reached;
    best_ = now_.x;
  }
  const ConicIterate iterate{summary->iterations, now_.scalar, now_.cost,
                             summary->gap,        step_,       &now_.x,
                             &multipliers_};
  if (options_.stop && options_.stop(iterate)) return Termination::kStopped;
  if (program_.kind == ConeProgram::Kind::kFeasibility &&
      now_.cost < program_.bound) {
    best_ = now_.x;
    return Termination::kFeasible;
  }
  if (summary->gap <= options_.smallest_gap) return Termination::kSmallestGap;
  return std::nullopt;
}

template <typename Cone>
InteriorPointSummary ConicSolver<Cone>::Run() {
  InteriorPointSummary summary;
  std::optional<InteriorPointTermination> end;
  while (!end && summary.iterations < options_.max_iterations) {
    end = Iterate(&summary);
  }
  summary.termination = end.value_or(InteriorPointTermination::kMaxIterations);
  return summary;
}

template <typename Cone>
int64_t ConicSolver<Cone>::MemoryBytes(const KnownRotationProblem& problem) {
  constexpr int64_t kPerObservation =
      sizeof(Multiplier) + 4 * sizeof(Vector) + 2 * sizeof(ViewedPoint);
  constexpr int64_t kPerUnknown = 4 * sizeof(Eigen::Vector3d);
  return static_cast<int64_t>(problem.observations.size()) * kPerObservation +
         (problem.num_points + problem.num_frames) * kPerUnknown +
         NewtonSystem<Cone>::MemoryBytes(problem);
}

template class ConicSolver<SecondOrderCone>;
template class ConicSolver<FourHalfLines>;

}  // namespace krot
