#include "krot/finish/least_squares.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "krot/base/check.h"
#include "krot/base/parallel_for.h"
#include "krot/conic/cones.h"
#include "krot/conic/path_following.h"
#include "krot/finish/bounded_system.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// The part of the barrier cost, below, that depends on one point while all
// cameras stay where they are.
template <typename Cap>
class PointBarrier {
 public:
  // Keeps references.
  PointBarrier(const KnownRotationProblem& problem, const Cap& cap,
               const BoundedOptions& options, int32_t num_views, double mu,
               const std::vector<Eigen::Vector3d>& translations)
      : problem_(problem),
        cap_(cap),
        options_(options),
        num_views_(num_views),
        mu_(mu),
        cameras_(CamerasFromWorld(problem, translations)) {}

  // Moves point k by Newton's steps until one promises to gain less than
  // gap_tolerance of the value. Fixed points stay.
  void Minimize(int32_t k, Eigen::Vector3d* point) const {
    if (problem_.IsFixedPoint(k)) return;
    double value = Value(k, *point);
    for (int n = 0; n < options_.max_iterations; ++n) {
      const Newton newton = NewtonStep(k, *point);
      if (!(newton.gain > options_.gap_tolerance * value)) return;
      Eigen::Vector3d moved;
      const auto is_lower = [&](double length) {
        moved = *point + length * newton.step;
        const double value_there = Value(k, moved);
        if (!(value_there < value)) return false;
        value = value_there;
        return true;
      };
      if (Backtrack(1, is_lower) == 0) return;
      *point = moved;
    }
  }

 private:
  struct Newton {
    Eigen::Vector3d step;
    double gain;  // promised by the quadratic model
  };

  // Infinite unless the point is in front of its cameras and below the cap.
  double Value(int32_t k, const Eigen::Vector3d& point) const {
    double value = 0;
    for (const int64_t i : problem_.OfPoint(k)) {
      const Observation& o = problem_.observations[i];
      const ViewedPoint viewed = ViewPoint(cameras_[o.view], o, point);
      if (!(viewed.depth > 0)) return kInfinity;
      const Eigen::Vector2d e = viewed.v / viewed.depth;
      const typename Cap::Vector h = cap_.Slacks(e);
      if (!(h.minCoeff() > 0)) return kInfinity;
      const double rho = options_.loss.Value(e.squaredNorm());
      value += (o.view < num_views_ ? rho / 2 : 0) -
               mu_ * std::log(cap_.RelativeSlack(h));
    }
    return value;
  }

  // Of the system of bounded_system.h with multipliers l_j = mu / h_j.
  Newton NewtonStep(int32_t k, const Eigen::Vector3d& point) const {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const int64_t i : problem_.OfPoint(k)) {
      const Observation& o = problem_.observations[i];
      const AffineMap& A = cameras_[o.view];
      const ViewedPoint viewed = ViewPoint(A, o, point);
      const Eigen::Vector2d e = viewed.v / viewed.depth;
      const Eigen::Matrix3d E = o.E * A.leftCols<3>() / viewed.depth;
      const Eigen::Matrix<double, 2, 3> J = E.bottomRows<2>() - e * E.row(0);
      const typename Cap::Vector inverse = cap_.Slacks(e).cwiseInverse();
      const Eigen::Matrix<double, 2, Cap::kNum> N =
          cap_.Normals(e) * inverse.asDiagonal();
      const double weight =
          o.view < num_views_ ? options_.loss.Weight(e.squaredNorm()) : 0;
      const double own = weight + mu_ * Cap::kBend * inverse.sum();
      H += J.transpose() * (own * J + mu_ * N * (N.transpose() * J)) +
           mu_ * Cap::kNum * E.row(0).transpose() * E.row(0);
      gradient += J.transpose() * (weight * e + mu_ * N.rowwise().sum());
    }
    const Eigen::Vector3d step = -H.ldlt().solve(gradient);
    return {step, -gradient.dot(step) / 2};
  }

  const KnownRotationProblem& problem_;
  const Cap& cap_;
  const BoundedOptions& options_;
  const int32_t num_views_;
  const double mu_;
  const std::vector<AffineMap> cameras_;
};

// One run along the central path: the minima of
//
//   1/2 sum rho - mu sum log(h_j(e) / h_j(0))
//
// as mu falls. A direction is a predictor's, mu = 0, and then a corrector's
// [Mehrotra 1992]. Its longest step is shortened until the barrier cost does
// not rise; where no step is found along the corrector's direction, one is
// looked for along Newton's.
//
// Multipliers take their full steps, each by itself, but none falls far below
// the path: whatever they are, as long as they are positive, a direction leads
// downwards, and the barrier cost alone decides on progress.
template <typename Cap>
class BoundedPath {
 public:
  BoundedPath(const KnownRotationProblem& problem,
              const BoundedOptions& options, const Context& context,
              const Estimate& start)
      : problem_(problem),
        options_(options),
        context_(context),
        system_(problem, Cap(options.norm, options.cap), options.loss,
                NumViews(), context),
        multipliers_(problem.observations.size()) {
    now_.x = start;
    now_.viewed.resize(problem.observations.size());
    trial_ = now_;
  }

  BoundedSummary Run() {
    if (!View(&now_)) {  // only with rows that are not those of x
      summary_.termination = InteriorPointTermination::kNoProgress;
      return summary_;
    }
    summary_.cost_initial = now_.cost;
    // It is large, as the start is near the boundary and has to leave it first.
    const double first_mu = MuOf(/*relative_gap=*/10);
    PlacePoints(first_mu);
    StartMultipliers(first_mu);
    summary_.termination = FollowPath(context_, options_.max_iterations, this,
                                      &summary_.iterations);
    summary_.cost_final = now_.cost;
    summary_.num_active = NumActive();
    return summary_;
  }

  const Estimate& estimate() const { return now_.x; }

  // The steps of FollowPath.
  bool Factorize() { return system_.Factorize(now_.viewed, multipliers_); }
  // Where the gap is small enough, tests whether Newton's step would gain
  // enough.
  bool IsThere() {
    summary_.duality_gap = RelativeGap();
    if (*summary_.duality_gap > options_.gap_tolerance) return false;
    system_.Solve(mu_);
    summary_.stationarity =
        now_.cost > 0 ? system_.Slope() / (2 * now_.cost) : 0;
    return *summary_.stationarity <= options_.stationarity_tolerance;
  }

  // The predicted gap is that of one common step of all multipliers: their own
  // full steps would promise too much.
  void FindDirection(double step) {
    target_mu_ = mu_;
    if (*summary_.duality_gap <= options_.gap_tolerance) return;  // Newton's
    if (step < kShortStep) return system_.Solve(mu_);
    system_.Solve(0);
    const double sigma =
        MehrotraSigma(system_.PredictedGap() / (Count() * mu_), 0.03);
    // Not below half of what the gap asked for needs.
    target_mu_ = std::max(MuOf(options_.gap_tolerance / 2), sigma * mu_);
    system_.Correct(target_mu_);
  }

  double TakeStep() {
    const double before = BarrierCost(now_, target_mu_);
    const double highest =
        before + kCostRounding * (now_.cost + target_mu_ * Count());
    // After a longer step to the boundary the next direction could not predict
    // the slacks.
    const auto search = [&] {
      return Backtrack(system_.MaxStep(/*damping=*/0.95),
                       [&](double step) { return TryStep(step, highest); });
    };
    double step = search();
    if (step == 0) {
      TakeRows(now_.x);
      system_.Solve(target_mu_);
      step = search();
    }
    if (step == 0) TakeRows(now_.x);
    gain_ = before - BarrierCost(now_, target_mu_);
    return step;
  }

  bool Recover() { return false; }

  // It ends after three short steps in a row that gain next to nothing, near
  // the gap asked for: lenses near their fold follow no linear row far.
  std::optional<InteriorPointTermination> Report(int iteration, double step) {
    if (options_.callback) {
      options_.callback({iteration, now_.cost, RelativeGap(), step});
    }
    const bool is_idle = step < 0.1 &&
                         gain_ < 0.01 * options_.gap_tolerance * now_.cost &&
                         *summary_.duality_gap <= 10 * options_.gap_tolerance;
    num_idle_ = is_idle ? num_idle_ + 1 : 0;
    if (num_idle_ == 3) return InteriorPointTermination::kNoProgress;
    return std::nullopt;
  }

 private:
  using Vector = typename Cap::Vector;

  struct State {
    Estimate x;
    std::vector<ViewedError<Cap>> viewed;
    double cost = 0;     // 1/2 sum rho
    double barrier = 0;  // -sum log(h_j(e) / h_j(0))
  };

  int32_t NumViews() const {
    return options_.num_views.value_or(
        static_cast<int32_t>(problem_.views.size()));
  }
  bool TakeRows(const Estimate& x) {
    return !options_.take_rows || AllRanks(context_, options_.take_rows(x));
  }
  // Fills in errors, cost and barrier. False unless every error is below the
  // cap.
  bool View(State* state) {
    if (!TakeRows(state->x)) return false;
    struct Totals {
      double least;  // slack
      double cost;
      // The sum of the logarithms of relative slacks is log_slacks and that of
      // `slacks`, a product, as one logarithm takes as long as all the rest.
      double log_slacks;
      double slacks;
    };
    const std::vector<AffineMap> cameras =
        CamerasFromWorld(problem_, state->x.translations);
    const Totals totals = system_.loop().Reduce(
        Totals{std::numeric_limits<double>::infinity(), 0, 0, 1},
        [&](int64_t i) -> Totals {
          const Observation& o = problem_.observations[i];
          const ViewedPoint viewed =
              ViewPoint(cameras[o.view], o, state->x.points[o.point]);
          if (!(viewed.depth > 0)) return {-1, 0, 0, 1};
          const Eigen::Vector2d e = viewed.v / viewed.depth;
          const Vector h = system_.cap().Slacks(e);
          state->viewed[i] = {e, viewed.depth, h};
          if (!(h.minCoeff() > 0)) return {-1, 0, 0, 1};
          const double loss =
              o.view < NumViews() ? options_.loss.Value(e.squaredNorm()) : 0;
          return {h.minCoeff(), loss / 2, 0, system_.cap().RelativeSlack(h)};
        },
        [](const Totals& a, const Totals& b) {
          Totals sum{std::min(a.least, b.least), a.cost + b.cost,
                     a.log_slacks + b.log_slacks, a.slacks * b.slacks};
          if (sum.slacks < 1e-100) {
            sum.log_slacks += std::log(std::exchange(sum.slacks, 1));
          }
          return sum;
        });
    state->cost = totals.cost;
    state->barrier = -(totals.log_slacks + std::log(totals.slacks));
    return totals.least > 0 && std::isfinite(state->cost);
  }

  double BarrierCost(const State& state, double mu) const {
    return state.cost + mu * state.barrier;
  }
  // The start may leave a point anywhere below the cap. Moves all points to the
  // minima of their own parts, or as far towards these as lenses allow.
  void PlacePoints(double mu) {
    const PointBarrier<Cap> barrier(problem_, system_.cap(), options_,
                                    NumViews(), mu, now_.x.translations);
    Estimate placed = now_.x;
    ParallelForEach(problem_.num_points, context_.num_threads, [&](int64_t k) {
      barrier.Minimize(static_cast<int32_t>(k), &placed.points[k]);
    });
    const auto try_share = [&](double share) {
      trial_.x = Between(now_.x, placed, share);
      return View(&trial_) && BarrierCost(trial_, mu) <= BarrierCost(now_, mu);
    };
    if (Backtrack(1, try_share) > 0) return std::swap(now_, trial_);
    TakeRows(now_.x);
  }

  double Count() const {  // of pairs
    return static_cast<double>(system_.loop().whole_count() * Cap::kNum);
  }
  double MuOf(double relative_gap) const {
    return relative_gap * now_.cost / Count();
  }
  double RelativeGap() const {
    return now_.cost > 0 ? Count() * mu_ / now_.cost : 0;
  }

  // mu / h. With multipliers of slacks h below a hundredth of the cap's, the
  // slack could only double in a step.
  void StartMultipliers(double mu) {
    const Vector least = 0.01 * system_.cap().Slacks(Eigen::Vector2d::Zero());
    const double gap = system_.loop().Sum([&](int64_t i) {
      const Vector& h = now_.viewed[i].h;
      multipliers_[i] = mu * h.cwiseMax(least).cwiseInverse();
      return multipliers_[i].dot(h);
    });
    mu_ = gap / Count();
  }

  bool TryStep(double step, double highest) {
    system_.Move(now_.x, step, &trial_.x);
    if (!View(&trial_) || !(BarrierCost(trial_, target_mu_) <= highest)) {
      return false;
    }
    MoveMultipliers();
    std::swap(now_, trial_);
    return true;
  }

  // Moves the multipliers to the slacks of trial_. Their products stay between
  // multiples of mu. With less, a multiplier may be too small to keep its error
  // off the cap in the next step, and a single pair holds back the step of all.
  void MoveMultipliers() {
    const double gap = system_.loop().Sum([&](int64_t i) {
      Vector& l = multipliers_[i];
      const Vector& h = trial_.viewed[i].h;
      const Vector centred = target_mu_ * h.cwiseInverse();
      l = (l + system_.StepOf(i).dl)
              .cwiseMax(0.3 * centred)
              .cwiseMin(1e5 * centred);
      return l.dot(h);
    });
    mu_ = gap / Count();
  }
  int64_t NumActive() const {
    return static_cast<int64_t>(system_.loop().Sum([&](int64_t i) {
      return system_.cap().Share(multipliers_[i]) > kActiveMultiplier ? 1.0
                                                                      : 0.0;
    }));
  }

  const KnownRotationProblem& problem_;  // rows: those of the last state viewed
  const BoundedOptions options_;
  const Context context_;
  BoundedSystem<Cap> system_;
  State now_, trial_;
  std::vector<Vector> multipliers_;
  double mu_ = 0;         // mean of the pairs at now_
  double target_mu_ = 0;  // that the direction aims at
  double gain_ = 0;       // what the last step took off the barrier cost
  int num_idle_ = 0;      // steps in a row
  BoundedSummary summary_;
};

template <typename Cap>
BoundedSummary Run(const KnownRotationProblem& problem,
                   const BoundedOptions& options, const Context& context,
                   Estimate* estimate) {
  BoundedPath<Cap> path(problem, options, context, *estimate);
  const BoundedSummary summary = path.Run();
  *estimate = path.estimate();
  return summary;
}

}  // namespace

BoundedSummary MinimizeBounded(const KnownRotationProblem& problem,
                               const BoundedOptions& options,
                               const Context& context, Estimate* estimate) {
  CheckConic(options.norm);
  CheckPositive(options.cap, "cap");
  CheckPositive(options.loss.scale, "loss.scale");
  CheckPositive(options.gap_tolerance, "gap_tolerance");
  CheckPositive(options.stationarity_tolerance, "stationarity_tolerance");
  CheckAtLeast(1, options.max_iterations, "max_iterations");
  const double cost = MaxOfRanks(
      context, Cost(problem, *estimate, options.norm, context.num_threads));
  CheckArgument(cost < options.cap, "cost of the start", cost, "below the cap");
  return options.norm.p == 2
             ? Run<DiscCap>(problem, options, context, estimate)
             : Run<PolygonCap>(problem, options, context, estimate);
}

}  // namespace krot::internal
