#include "krot/finish/bounded_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "krot/finish/log_product.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

// The first mu, as a share of the cost by pair: the start is near the boundary,
// and has to leave it first.
constexpr double kStartWeight = 10;
// The first multipliers are those of slacks of this share of the cap's at
// least. Nearer to the boundary they would let the slack grow by no more than
// itself in a step.
constexpr double kStartSlack = 0.01;
// A step goes so far of the way to the boundary: one that all but reached it
// would leave a slack that the next direction cannot predict,
constexpr double kDamping = 0.95;
// and so far of one that does not lower the barrier cost; one shorter than the
// last is none.
constexpr double kBacktracking = 0.5;
constexpr double kSmallestStep = 1e-6;
// What rounding may add to the barrier cost, relative.
constexpr double kCostRounding = 1e-13;
// No pair's product is less than this share of mu: what the step leaves of a
// multiplier may be too little to keep its error off the cap in the next one,
// and a single pair holds back the step of all. Nor is it more than the second.
constexpr double kLeastProduct = 0.3;
constexpr double kLargestProduct = 1e5;
// After a step shorter than this, the next one only centres.
constexpr double kShortStep = 0.03;
// With a gap this near to that asked for, in such gaps, so many steps in a row
// that are shorter than kIdleStep and gain less of the cost end it: lenses near
// their fold follow no linear row far.
constexpr double kIdleStep = 0.1;
constexpr double kNearGap = 10;
constexpr double kLeastGain = 0.01;
constexpr int kPatience = 3;
// Mehrotra's sigma is no less, whatever the predictor leaves of the gap.
constexpr double kSmallestSigma = 0.03;
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

template <typename Cap>
BoundedPath<Cap>::BoundedPath(const KnownRotationProblem& problem,
                              const BoundedOptions& options,
                              const Context& context, const Estimate& start)
    : problem_(problem),
      options_(options),
      context_(context),
      system_(problem, Cap(options.norm, options.cap), options.loss, NumViews(),
              context),
      multipliers_(problem.observations.size()) {
  now_.x = start;
  now_.viewed.resize(problem.observations.size());
  trial_ = now_;
}

template <typename Cap>
bool BoundedPath<Cap>::View(State* state) {
  if (!TakeRows(state->x)) return false;
  struct Totals {
    double least;  // slack
    double cost;
    LogProduct slacks;
  };
  const Totals totals = system_.loop().Reduce(
      Totals{std::numeric_limits<double>::infinity(), 0, {}},
      [&](int64_t i) -> Totals {
        const ViewedPoint viewed =
            ViewPoint(problem_, problem_.observations[i], state->x);
        if (!(viewed.depth > 0)) return {-1, 0, {}};
        const Eigen::Vector2d e = viewed.v / viewed.depth;
        state->viewed[i] = {e, viewed.depth};
        const Vector h = system_.cap().Slacks(e);
        if (!(h.minCoeff() > 0)) return {-1, 0, {}};
        const double loss = problem_.observations[i].view < NumViews()
                                ? options_.loss.Value(e.squaredNorm())
                                : 0;
        return {h.minCoeff(), loss / 2,
                LogProduct(system_.cap().RelativeSlack(h))};
      },
      [](const Totals& a, const Totals& b) {
        return Totals{std::min(a.least, b.least), a.cost + b.cost,
                      a.slacks.Times(b.slacks)};
      });
  state->cost = totals.cost;
  state->barrier = -totals.slacks.Log();
  return totals.least > 0 && std::isfinite(state->cost);
}

template <typename Cap>
void BoundedPath<Cap>::CentreMultipliers(double mu, double least_slack) {
  const Vector least =
      least_slack * system_.cap().Slacks(Eigen::Vector2d::Zero());
  const double gap = system_.loop().Sum([&](int64_t i) {
    const Vector h = system_.cap().Slacks(now_.viewed[i].e);
    multipliers_[i] = mu * h.cwiseMax(least).cwiseInverse();
    return multipliers_[i].dot(h);
  });
  mu_ = gap / Count();
}

// Returns the mu that the direction aims at.
template <typename Cap>
double BoundedPath<Cap>::FindDirection() {
  if (step_ < kShortStep) {
    system_.Solve(mu_);
    return mu_;
  }
  system_.Solve(0);
  const double mu =
      std::max(MuOf(kLastShare * options_.gap_tolerance), AffineSigma() * mu_);
  system_.Correct(mu);
  return mu;
}

// Mehrotra's choice: the cube of what the predictor leaves of the gap if all
// multipliers take one step: their full ones would promise too much.
template <typename Cap>
double BoundedPath<Cap>::AffineSigma() const {
  const double gap =
      system_.GapAfter(system_.MaxStep(1), system_.MaxDualStep());
  const double left = std::max(0.0, gap / (Count() * mu_));
  return std::min(1.0, std::max(kSmallestSigma, left * left * left));
}

template <typename Cap>
double BoundedPath<Cap>::TakeStep(double mu) {
  const double before = BarrierCost(now_, mu);
  const double highest = before + kCostRounding * (now_.cost + mu * Count());
  for (double step = system_.MaxStep(kDamping); step >= kSmallestStep;
       step *= kBacktracking) {
    MoveTo(now_.x, system_.dx(), step, &trial_.x);
    if (!View(&trial_) || !(BarrierCost(trial_, mu) <= highest)) continue;
    MoveMultipliers(mu);
    std::swap(now_, trial_);
    step_ = step;
    return before - BarrierCost(now_, mu);
  }
  TakeRows(now_.x);
  step_ = 0;
  return 0;
}

// To those of trial_.
template <typename Cap>
void BoundedPath<Cap>::MoveMultipliers(double mu) {
  const double gap = system_.loop().Sum([&](int64_t i) {
    Vector& l = multipliers_[i];
    const Vector h = system_.cap().Slacks(trial_.viewed[i].e);
    const Vector centred = mu * h.cwiseInverse();
    l = (l + system_.StepOf(i).dl)
            .cwiseMax(kLeastProduct * centred)
            .cwiseMin(kLargestProduct * centred);
    return l.dot(h);
  });
  mu_ = gap / Count();
}

// Why the run ends here, if it does.
template <typename Cap>
std::optional<BoundedTermination> BoundedPath<Cap>::Iterate(
    BoundedSummary* summary) {
  if (context_.IsCancelled()) return BoundedTermination::kInterrupted;
  if (!system_.Factorize(now_.viewed, multipliers_)) {
    return BoundedTermination::kSingular;
  }
  summary->duality_gap = RelativeGap();
  double mu = mu_;
  if (*summary->duality_gap <= options_.gap_tolerance) {
    system_.Solve(mu);
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
    system_.Solve(mu);
    gain = TakeStep(mu);
  }
  if (step_ == 0) {
    if (is_centred_) return BoundedTermination::kNoProgress;
    CentreMultipliers(mu, 0);
    is_centred_ = true;
    return std::nullopt;
  }
  is_centred_ = false;
  ++summary->iterations;
  if (options_.callback) {
    options_.callback({summary->iterations, now_.cost, RelativeGap(), step_});
  }
  const bool is_idle =
      step_ < kIdleStep &&
      gain < kLeastGain * options_.gap_tolerance * now_.cost &&
      *summary->duality_gap <= kNearGap * options_.gap_tolerance;
  num_idle_ = is_idle ? num_idle_ + 1 : 0;
  if (num_idle_ == kPatience) return BoundedTermination::kNoProgress;
  return std::nullopt;
}

template <typename Cap>
int64_t BoundedPath<Cap>::NumActive() const {
  return static_cast<int64_t>(system_.loop().Sum([&](int64_t i) {
    return system_.cap().Share(multipliers_[i]) > kActiveMultiplier ? 1.0 : 0.0;
  }));
}

template <typename Cap>
BoundedSummary BoundedPath<Cap>::Run() {
  BoundedSummary summary;
  if (!View(&now_)) {  // as only rows can make it that are not those of x
    summary.termination = BoundedTermination::kNoProgress;
    return summary;
  }
  summary.cost_initial = now_.cost;
  CentreMultipliers(MuOf(kStartWeight), kStartSlack);
  std::optional<BoundedTermination> end;
  while (!end && summary.iterations < options_.max_iterations) {
    end = Iterate(&summary);
  }
  summary.termination = end.value_or(BoundedTermination::kMaxIterations);
  summary.cost_final = now_.cost;
  summary.num_active = NumActive();
  return summary;
}

template <typename Cap>
int64_t BoundedPath<Cap>::MemoryBytes(const KnownRotationProblem& problem) {
  constexpr int64_t kPerObservation = sizeof(Vector) + 2 * sizeof(ViewedError);
  constexpr int64_t kPerUnknown = 2 * sizeof(Eigen::Vector3d);
  return static_cast<int64_t>(problem.observations.size()) * kPerObservation +
         (problem.num_points + problem.num_frames) * kPerUnknown +
         BoundedSystem<Cap>::MemoryBytes(problem);
}

template class BoundedPath<DiscCap>;
template class BoundedPath<PolygonCap>;

}  // namespace krot
