#include "krot/adjust/adjustment_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "krot/adjust/barrier_system.h"
#include "krot/base/context.h"
#include "krot/conic/path_following.h"

namespace krot::internal {
namespace {

// The path has converged once the gap, relative to what is minimised, is below
// this.
constexpr double kGapTolerance = 1e-4;
// A step leaves at least this share of the way to the cap, and of a multiplier.
constexpr double kBoundaryShare = 0.01;
constexpr double kLeastRadius = 1e-6;
constexpr double kLargestRadius = 1e6;

// Steps of a primal-dual interior point method towards the minima of the
// barrier problem of barrier_system.h as its weight mu falls: along Newton's
// direction, cut short of the cap and until the barrier cost falls. Every
// iterate is feasible. The cap moves where it has columns.
class BarrierPath {
 public:
  // Requires errors of `start` below its cap. Keeps references to all but the
  // start.
  BarrierPath(const BundleAdjustmentOptions& options, const Context& context,
              const AdjustmentColumns& columns, const AdjustmentBlocks& start,
              BundleAdjustmentSummary* summary)
      : options_(options),
        context_(context),
        columns_(columns),
        system_(columns, start, context.num_threads),
        now_(start),
        trial_(start),
        errors_(
            *ProjectErrors(start, std::sqrt(start.cap2), context.num_threads)),
        cost_(HalfSquaredNorm(errors_)),
        multipliers_(errors_.size()),
        radius_(kLargestRadius),
        summary_(*summary) {}

  // Begin with a cap that stays, or with one that is lowered.
  //
  // The first weight is a multiple of the mean cost of an observation. With a
  // small one a start near the cap stays there, or a poorer local minimum is
  // found: at 1.02 times its lowest maximum, a model took 19 steps to 11164
  // pixels^2 with 15, 23 steps to 11222 with 10, and 21 steps to 11323 with 3.
  void BeginBelowCap() { Begin(15 * cost_ / count(), 0); }
  // The square of the cap has 10^4 times the weight of the squared errors,
  // which therefore raise the square of the lowest maximum by at most 2e-4,
  // relative. For this mu the cap has no slope at the start.
  void BeginAtCap() {
    const double cap_weight = 1e4 * cost_ / cap2();
    double sum = 0;
    for (const ProjectedError& error : errors_) sum += 1 / SlackOf(error);
    Begin(cap_weight / sum, cap_weight);
  }

  InteriorPointTermination Follow() {
    return FollowPath(context_, options_.max_num_iterations, this,
                      &summary_.num_iterations);
  }

  // The steps of FollowPath.
  bool Factorize() { return true; }  // TakeStep does, for every radius
  bool IsThere() const { return false; }
  void FindDirection(double) {}
  double TakeStep() {
    const double highest =
        BarrierCost(errors_, cap2()) + kCostRounding * Objective();
    for (; radius_ >= kLeastRadius; radius_ /= 100) {
      const double longest = FindNewtonDirection() ? LongestStep() : 0;
      const double step = Backtrack(
          longest, [&](double length) { return TryStep(length, highest); });
      if (step == 0) continue;
      UpdateRadius(step / longest);
      return step;
    }
    radius_ = kLargestRadius;
    CentreMultipliers();
    return 0;
  }

  // An iteration without a step counts, too.
  bool Recover() {
    Tell(++summary_.num_iterations, 0);
    if (IsGapReached()) return false;
    LowerWeight(1);
    return true;
  }

  std::optional<InteriorPointTermination> Report(int iteration, double step) {
    Tell(iteration, step);
    if (IsConverged()) return InteriorPointTermination::kConverged;
    LowerWeight(step);
    return std::nullopt;
  }

  // The gap is the sum of multiplier times slack, relative to what is
  // minimised, the cap with its weight included.
  double gap() const {
    return Objective() > 0 ? count() * mu_ / Objective() : 0;
  }
  bool IsGapReached() const {
    return count() * mu_ <= kGapTolerance * Objective();
  }
  // g' D^-1 g / 2, relative to what is minimised: BarrierSystem::SingleGains.
  std::optional<double> MeasureStationarity() {
    if (!FindNewtonDirection()) return std::nullopt;
    return Objective() > 0 ? system_.SingleGains() / Objective() : 0;
  }

  bool IsConverged() {
    if (!IsGapReached()) return false;
    const std::optional<double> stationarity = MeasureStationarity();
    return stationarity && *stationarity <= 1e-6;
  }

  const AdjustmentBlocks& blocks() const { return now_; }
  double LargestError() const { return internal::LargestError(errors_); }
  int64_t NumActive() const {
    return std::count_if(errors_.begin(), errors_.end(),
                         [&](const ProjectedError& error) {
                           return mu_ / SlackOf(error) > kActiveMultiplier;
                         });
  }

  // The name of the linear solver, as the summary has it.
  const char* SolverName() const {
    switch (system_.kind()) {
      case ReducedCameraSystem::Kind::kSparse:
        return "sparse_schur";
      case ReducedCameraSystem::Kind::kIterative:
        return "iterative_schur";
      default:
        return "dense_schur";
    }
  }

 private:
  using Errors = std::vector<ProjectedError>;

  double count() const { return static_cast<double>(errors_.size()); }
  double cap2() const { return now_.cap2; }
  double SlackOf(const ProjectedError& error) const {
    return Slack(cap2(), error.r.squaredNorm());
  }
  double Objective() const { return cost_ + cap_weight_ * cap2() / 2; }
  double BarrierCost(const Errors& errors, double cap2) const {
    double sum = 0;
    for (const ProjectedError& error : errors) {
      const double squared = error.r.squaredNorm();
      sum += squared / 2 - mu_ * std::log1p(-squared / cap2);
    }
    if (cap_weight_ > 0) {
      sum += cap_weight_ * cap2 / 2 - mu_ * count() * std::log(cap2);
    }
    return sum;
  }

  // Begins with this weight, and with the multipliers that its minimum has.
  // Half of cap_weight is the price of the cap's square, where that moves.
  void Begin(double mu, double cap_weight) {
    mu_ = mu;
    cap_weight_ = cap_weight;
    CentreMultipliers();
  }

  // Newton's direction, if there is one.
  bool FindNewtonDirection() {
    if (!factor_radius_) system_.Linearize(now_, errors_, multipliers_);
    if (factor_radius_ != radius_) {
      factor_radius_.reset();
      if (!system_.Factorize(radius_)) return false;
      factor_radius_ = radius_;
    }
    system_.Solve(mu_, cap_weight_);
    return true;
  }

  // The derivative of a slack along the direction: that of w h, divided by w.
  double SlackSlope(size_t i) const {
    const Eigen::Vector3d& slope = system_.direction().slopes[i];
    return SlackOf(errors_[i]) * slope[2] / errors_[i].w -
           errors_[i].r.dot(slope.head<2>()) + system_.cap2_slope() / 2;
  }

  // The longest step at most 1 that the linearised errors allow.
  double LongestStep() const {
    double longest = 1;
    for (size_t i = 0; i < errors_.size(); ++i) {
      // w r, w and cap w are nearly affine: |r + step v| = cap (1 + step u)
      const Eigen::Vector3d& slope = system_.direction().slopes[i];
      const double w_slope = slope[2] / errors_[i].w;
      const Eigen::Vector2d v = slope.head<2>() + w_slope * errors_[i].r;
      const double u = w_slope + system_.cap2_slope() / (2 * cap2());
      const double a = cap2() * u * u - v.squaredNorm();
      const double b = cap2() * u - errors_[i].r.dot(v);
      const double c = 2 * SlackOf(errors_[i]);
      const double discriminant = b * b - a * c;
      if (discriminant < 0) continue;
      const double denominator = std::sqrt(discriminant) - b;
      if (denominator <= 0) continue;
      longest = std::min(longest, (1 - kBoundaryShare) * c / denominator);
    }
    return longest;
  }

  // Takes a step of that length if the errors stay below the cap and the
  // barrier cost is at most the given one.
  bool TryStep(double step, double highest_cost) {
    MoveAlong(columns_, now_, system_.direction().unknowns, step, &trial_);
    std::optional<Errors> stepped =
        ProjectErrors(trial_, std::sqrt(trial_.cap2), context_.num_threads);
    if (!stepped || !(BarrierCost(*stepped, trial_.cap2) <= highest_cost)) {
      return false;
    }
    UpdateMultipliers(*stepped, trial_.cap2);
    std::swap(now_, trial_);
    errors_ = std::move(*stepped);
    cost_ = HalfSquaredNorm(errors_);
    factor_radius_.reset();
    return true;
  }

  void CentreMultipliers() {
    for (size_t i = 0; i < errors_.size(); ++i) {
      multipliers_[i] = mu_ / SlackOf(errors_[i]);
    }
    factor_radius_.reset();
  }
  void UpdateMultipliers(const Errors& stepped, double stepped_cap2) {
    for (size_t i = 0; i < errors_.size(); ++i) {
      const double h = SlackOf(errors_[i]);
      const double lambda = multipliers_[i];
      // lambda h + h dlambda + lambda dh = mu
      const double newton = (mu_ - lambda * SlackSlope(i)) / h;
      const double central =
          mu_ / Slack(stepped_cap2, stepped[i].r.squaredNorm());
      multipliers_[i] = std::clamp(std::max(newton, kBoundaryShare * lambda),
                                   central / 100, central * 100);
    }
  }

  // After a step that was this share of the longest one that the linearised
  // errors allow.
  void UpdateRadius(double share) {
    if (share < 0.3) {
      radius_ = std::max(radius_ / 10, std::min(radius_, 1.0));
    } else if (share > 0.5) {
      radius_ = std::min(10 * radius_, kLargestRadius);
    }
  }

  // After a short step the minimum for this weight is still far away; if the
  // weight fell then, all further steps would be short.
  void LowerWeight(double step) {
    if (step < 0.5) return;
    const double last = 0.5 * kGapTolerance * Objective() / count();
    mu_ = std::max(last, 0.2 * mu_);
  }

  void Tell(int iteration, double step) const {
    if (!options_.callback) return;
    BundleAdjustmentIteration told;
    told.iteration = iteration;
    told.cost = cost_;
    told.radius = radius_;
    told.is_successful = step > 0;
    told.barrier = mu_;
    told.cap = std::sqrt(cap2());
    told.seconds = timer_.Seconds();
    options_.callback(told);
  }

  const BundleAdjustmentOptions& options_;
  const Context& context_;
  const Timer timer_;
  const AdjustmentColumns& columns_;
  BarrierSystem system_;
  AdjustmentBlocks now_, trial_;
  Errors errors_;    // now
  double cost_ = 0;  // half their squared norm, pixels^2
  std::vector<double> multipliers_;
  double mu_ = 0;          // pixels^2
  double cap_weight_ = 0;  // 0 where the cap stays as it is
  double radius_;          // of the trust region
  // The radius with which the system at now_ is factorised; none if it is not.
  std::optional<double> factor_radius_;
  BundleAdjustmentSummary& summary_;
};

BundleAdjustmentTermination TerminationOf(InteriorPointTermination end,
                                          bool is_converged) {
  using Termination = BundleAdjustmentTermination;
  if (end == InteriorPointTermination::kInterrupted) {
    return Termination::kInterrupted;
  }
  if (is_converged) return Termination::kCapConverged;
  return end == InteriorPointTermination::kMaxIterations
             ? Termination::kMaxIterations
             : Termination::kStalled;
}

}  // namespace

void AdjustBelowCap(const BundleAdjustmentOptions& options,
                    const Context& context, const AdjustmentColumns& columns,
                    AdjustmentBlocks* blocks,
                    BundleAdjustmentSummary* summary) {
  BarrierPath path(options, context, columns, *blocks, summary);
  summary->linear_solver = path.SolverName();
  path.BeginBelowCap();
  const InteriorPointTermination end = path.Follow();
  summary->termination = TerminationOf(end, path.IsConverged());
  summary->stationarity = path.MeasureStationarity();
  summary->duality_gap = path.gap();
  summary->num_active = path.NumActive();
  *blocks = path.blocks();
}

void LowerMaxError(const BundleAdjustmentOptions& options,
                   const Context& context, const AdjustmentColumns& columns,
                   AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary) {
  AdjustmentColumns with_cap = columns;
  with_cap.AddCap();
  const double start_error = LargestError(*ProjectErrors(
      *blocks, std::numeric_limits<double>::infinity(), context.num_threads));
  blocks->cap2 = std::pow(1.1 * start_error, 2);
  BarrierPath path(options, context, with_cap, *blocks, summary);
  path.BeginAtCap();
  path.Follow();
  summary->is_lowest_max_error_converged = path.IsConverged();
  summary->lowest_max_error = std::min(path.LargestError(), start_error);
  const double cap = (1 + 5e-4) * *summary->lowest_max_error;
  // The least squares below this cap need some room at their start.
  if (path.LargestError() < (1 - 1e-4) * cap) *blocks = path.blocks();
  blocks->cap2 = cap * cap;
}

}  // namespace krot::internal
