#include "krot/finish/bounded_path.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/conic/centrality.h"

namespace krot {
namespace {

// The first mu, as a share of the cost by pair. The start is near the boundary:
// with a weight of 1, door_colmap took 23 iterations, with 10 to 100 it and the
// other models take 9 to 11.
// (to a gap of 1e-4).
constexpr double kStartWeight = 30;
// A step goes so far of the way to the boundary,
constexpr double kDamping = 0.99;
// and so far of one that does not lower the barrier cost; one shorter than the
// last is none.
constexpr double kBacktracking = 0.5;
constexpr double kSmallestStep = 1e-6;
// What rounding may add to the barrier cost, relative.
constexpr double kCostRounding = 1e-13;
// Pairs whose products are beyond these shares of mu are centred anew.
constexpr double kLeastProduct = 1e-3;
constexpr double kLargestProduct = 1e3;
// After a step shorter than this, the next one only centres.
constexpr double kShortStep = 0.1;
// With a gap this near to that asked for, in such gaps, so many short steps in
// a row that gain less of the cost end it: lenses near their fold follow no
// linear row far.
constexpr double kNearGap = 10;
constexpr double kLeastGain = 0.1;
constexpr int kPatience = 3;
// Mehrotra's sigma is no less, whatever the predictor leaves of the gap.
constexpr double kSmallestSigma = 1e-3;
// mu does not fall below this share of what the gap asked for needs.
constexpr double kLastShare = 0.5;
// Multipliers above this count as active: an error's own weight is 1.
constexpr double kActiveMultiplier = 1e-3;

void MoveTo(const Estimate& from, const BlockVector& direction, double step,
            Estimate* x) {
  for (size_t k = 0; k < x->points.size(); ++k) {
    x->points[k] = from.points[k] + step * direction.points[k];
  }
  for (size_t f = 0; f < x->translations.size(); ++f) {
    x->translations[f] = from.translations[f] + step * direction.frames[f];
  }
}

}  // namespace

template <typename Cone>
BoundedPath<Cone>::BoundedPath(const KnownRotationProblem& problem,
                               const BoundedOptions& options,
                               const Context& context, const Estimate& start)
    : problem_(problem),
      options_(options),
      context_(context),
      system_(problem, options.norm, options.cap, options.loss,
              context.num_threads),
      z_(problem.observations.size()) {
  now_.x = start;
  now_.viewed.resize(problem.observations.size());
  if (options_.take_rows) now_.rows = problem;
  trial_ = now_;
}

template <typename Cone>
bool BoundedPath<Cone>::View(State* state) const {
  if (options_.take_rows && !options_.take_rows(state->x, &state->rows)) {
    return false;
  }
  const std::vector<Observation>& observations = RowsOf(*state).observations;
  const double least = system_.loop().Min([&](int64_t i) {
    state->viewed[i] = ViewPoint(problem_, observations[i], state->x);
    if (!(state->viewed[i].depth > 0)) return -1.0;
    return Cone::SmallestEigenvalue(system_.Slack(state->viewed[i]));
  });
  if (!(least > 0)) return false;
  state->cost = system_.loop().Sum([&](int64_t i) {
    const ViewedPoint& viewed = state->viewed[i];
    return options_.loss.Value((viewed.v / viewed.depth).squaredNorm()) / 2;
  });
  state->barrier = system_.loop().Sum(
      [&](int64_t i) { return system_.Barrier(state->viewed[i]); });
  return std::isfinite(state->barrier);
}

template <typename Cone>
void BoundedPath<Cone>::CentreMultipliers(double mu) {
  system_.loop().ForEach([&](int64_t i) {
    z_[i] = mu * Cone::Divide(system_.Slack(now_.viewed[i]), Cone::Identity());
  });
}

template <typename Cone>
void BoundedPath<Cone>::RestoreNeighbourhood(double mu) {
  system_.loop().ForEach([&](int64_t i) {
    const Vector s = system_.Slack(now_.viewed[i]);
    if (Cone::SmallestEigenvalue(z_[i]) > 0 &&
        Cone::SmallestProduct(s, z_[i]) >= kLeastProduct * mu &&
        s.dot(z_[i]) <= kLargestProduct * mu) {
      return;
    }
    z_[i] = mu * Cone::Divide(s, Cone::Identity());
  });
}

template <typename Cone>
void BoundedPath<Cone>::FindNewtonDirection(double mu) {
  system_.Solve(
      [&](int64_t i) -> Vector {
        return mu * Cone::Divide(system_.lambda()[i], Cone::Identity());
      },
      mu);
}

// Returns the mu that the direction aims at.
template <typename Cone>
double BoundedPath<Cone>::FindDirection() {
  const double last = kLastShare * options_.gap_tolerance * now_.cost / Count();
  if (step_ < kShortStep) {
    FindNewtonDirection(system_.mu());
    return system_.mu();
  }
  system_.Solve([](int64_t) -> Vector { return Vector::Zero(); }, 0);
  const double mu = std::max(last, AffineSigma() * system_.mu());
  system_.Solve(
      [&](int64_t i) -> Vector {
        const Vector target =
            mu * Cone::Identity() -
            Cone::Product(system_.direction().ds[i], system_.direction().dz[i]);
        return Cone::Divide(system_.lambda()[i], target);
      },
      mu);
  ImproveCentrality<Cone>(
      mu, mu,
      [&] {
        return std::min(MaxStep(system_.direction().ds, kDamping),
                        MaxStep(system_.direction().dz, kDamping));
      },
      &system_);
  return mu;
}

template <typename Cone>
double BoundedPath<Cone>::AffineSigma() const {
  const double primal = MaxStep(system_.direction().ds, 1);
  const double dual = MaxStep(system_.direction().dz, 1);
  const double gap = system_.loop().Sum([&](int64_t i) {
    const Vector& lambda = system_.lambda()[i];
    return (lambda + primal * system_.direction().ds[i])
        .dot(lambda + dual * system_.direction().dz[i]);
  });
  const double left = std::max(0.0, gap / (Count() * system_.mu()));
  return std::min(1.0, std::max(kSmallestSigma, left * left * left));
}

template <typename Cone>
double BoundedPath<Cone>::MaxStep(const std::vector<Vector>& direction,
                                  double damping) const {
  return damping * system_.loop().Min([&](int64_t i) {
    return Cone::MaxStep(system_.lambda()[i], direction[i], 1 / damping);
  });
}

template <typename Cone>
double BoundedPath<Cone>::TakeStep(double mu) {
  const double before = BarrierCost(now_, mu);
  const double highest = before + kCostRounding * (now_.cost + mu * Count());
  for (double step = MaxStep(system_.direction().ds, kDamping);
       step >= kSmallestStep; step *= kBacktracking) {
    MoveTo(now_.x, system_.direction().dx, step, &trial_.x);
    if (!View(&trial_) || !(BarrierCost(trial_, mu) <= highest)) continue;
    std::swap(now_, trial_);
    const double dual = MaxStep(system_.direction().dz, kDamping);
    system_.loop().ForEach(
        [&](int64_t i) { z_[i] += dual * system_.UnscaledDz(i); });
    RestoreNeighbourhood(mu);
    step_ = step;
    return before - BarrierCost(now_, mu);
  }
  step_ = 0;
  return 0;
}

// Why the run ends here, if it does.
template <typename Cone>
std::optional<BoundedTermination> BoundedPath<Cone>::Iterate(
    BoundedSummary* summary) {
  if (context_.IsCancelled()) return BoundedTermination::kInterrupted;
  if (!system_.Factorize(RowsOf(now_).observations, now_.viewed, z_)) {
    return BoundedTermination::kSingular;
  }
  summary->duality_gap = RelativeGap();
  double mu = system_.mu();
  if (*summary->duality_gap <= options_.gap_tolerance) {
    FindNewtonDirection(mu);
    summary->stationarity =
        now_.cost > 0 ? system_.Slope() / (2 * now_.cost) : 0;
    if (*summary->stationarity <= options_.stationarity_tolerance) {
      return BoundedTermination::kConverged;
    }
  } else {
    mu = FindDirection();
  }
  double gain = TakeStep(mu);
  if (step_ == 0) {
    FindNewtonDirection(mu);
    gain = TakeStep(mu);
  }
  if (step_ == 0) return BoundedTermination::kNoProgress;
  ++summary->iterations;
  if (options_.callback) {
    options_.callback({summary->iterations, now_.cost, RelativeGap(), step_});
  }
  const bool is_idle =
      step_ < kShortStep &&
      gain < kLeastGain * options_.gap_tolerance * now_.cost &&
      *summary->duality_gap <= kNearGap * options_.gap_tolerance;
  num_idle_ = is_idle ? num_idle_ + 1 : 0;
  if (num_idle_ == kPatience) return BoundedTermination::kNoProgress;
  return std::nullopt;
}

template <typename Cone>
int64_t BoundedPath<Cone>::NumActive() const {
  // Of h = (cap^2 - |e|^2) / 2, or of cap - a'e: z is by the unit of depth.
  return static_cast<int64_t>(system_.loop().Sum([&](int64_t i) {
    const double multiplier =
        z_[i].maxCoeff() * now_.viewed[i].depth / options_.cap;
    return multiplier > kActiveMultiplier ? 1.0 : 0.0;
  }));
}

template <typename Cone>
BoundedSummary BoundedPath<Cone>::Run() {
  BoundedSummary summary;
  if (!View(&now_)) {  // as only rows can make it that are not those of x
    summary.termination = BoundedTermination::kNoProgress;
    return summary;
  }
  summary.cost_initial = now_.cost;
  CentreMultipliers(kStartWeight * now_.cost / Count());
  std::optional<BoundedTermination> end;
  while (!end && summary.iterations < options_.max_iterations) {
    end = Iterate(&summary);
  }
  summary.termination = end.value_or(BoundedTermination::kMaxIterations);
  summary.cost_final = now_.cost;
  summary.num_active = NumActive();
  return summary;
}

template <typename Cone>
int64_t BoundedPath<Cone>::MemoryBytes(const KnownRotationProblem& problem,
                                       bool rows_are_taken_anew) {
  const int64_t per_observation =
      sizeof(Vector) + 2 * sizeof(ViewedPoint) +
      (rows_are_taken_anew ? 2 * (sizeof(Observation) + sizeof(int32_t)) : 0);
  constexpr int64_t kPerUnknown = 2 * sizeof(Eigen::Vector3d);
  return static_cast<int64_t>(problem.observations.size()) * per_observation +
         (problem.num_points + problem.num_frames) * kPerUnknown +
         BoundedSystem<Cone>::MemoryBytes(problem);
}

template class BoundedPath<SecondOrderCone>;
template class BoundedPath<FourHalfLines>;

}  // namespace krot
