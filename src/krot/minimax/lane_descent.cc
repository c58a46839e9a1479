#include "krot/minimax/kernels.h"

#include "krot/minimax/lane_model.h"

namespace krot::internal::KROT_UNITS {
namespace {

LaneMask IsSet(const LaneDoubles& flag) { return Load(flag) == 1; }
Lanes Flag(const LaneMask& mask) { return Select(mask, 1, 0); }

// One call of StepLanes.
class Stepping {
 public:
  Stepping(const LaneRows& rows, const LaneGoal& goal, LaneDescents* descents,
           LanePiece* pieces)
      : rows_(rows), goal_(goal), descents_(*descents), pieces_(pieces) {}

  void Run() {
    LoadDescents();
    Linearize();
    UpdateMetric();
    Minimize();
    Try();
    Decide();
    StoreDescents();
  }

 private:
  void LoadDescents();
  void Linearize();
  void LookAtFresh();
  void UpdateMetric();
  void Minimize();
  void UpdateMultipliers();
  void Try();
  void Decide();
  void Learn(const LaneMask& learns);
  void SetStatus(const LaneMask& where, double status) {
    status_ = Select(where, status, status_);
  }
  void StoreDescents();

  const LaneRows rows_;
  const LaneGoal& goal_;
  LaneDescents& descents_;
  LanePiece* pieces_;

  // Kept in `descents_` between calls.
  Lanes status_, cost_, kappa_, lessons_, cost_failed_;
  Lanes3 x_;
  LaneHull hull_;

  // Used within this call only.
  LaneMask is_fresh_, is_running_, is_far_, is_cold_;
  LaneMatrix curvature_, metric_;
  LaneStep step_;
  LaneMask is_solved_;
  Lanes multiplier_[kCorners];
  LaneMask bears_, has_grown_, adopts_;
  Lanes share_, cost_trial_;
  Lanes3 x_trial_;
};

void Stepping::LoadDescents() {
  status_ = Load(descents_.status);
  cost_ = Load(descents_.cost);
  kappa_ = Load(descents_.kappa);
  lessons_ = Load(descents_.lessons);
  cost_failed_ = Load(descents_.cost_failed);
  is_cold_ = IsSet(descents_.is_cold);
  x_ = Load(descents_.x);
  hull_.size = 0;
  for (int a = 0; a < kCorners; ++a) {
    hull_.corner[a].index = Load(descents_.index[a]);
    hull_.corner[a].weight = Load(descents_.weight[a]);
    hull_.size += Flag(hull_.corner[a].index > kNoPieceIndex);
    multiplier_[a] = Load(descents_.multiplier[a]);
  }
}

void Stepping::Linearize() {
  Lanes cost;
  curvature_ = LinearizeLanes(rows_, x_, multiplier_, IsSet(descents_.raises),
                              pieces_, &hull_, &cost);
  is_fresh_ = status_ == kLaneFresh;
  cost_ = Select(is_fresh_, cost, cost_);
  LookAtFresh();
  is_running_ = status_ == kLaneRuns;
}

void Stepping::LookAtFresh() {
  Store(Select(is_fresh_, cost_, Load(descents_.cost_initial)),
        &descents_.cost_initial);
  SetStatus(is_fresh_, kLaneRuns);
  SetStatus(is_fresh_ & (cost_ <= goal_.sufficient), kLaneLowEnough);
  SetStatus(is_fresh_ & (cost_ <= kZeroPixels), kLaneZeroCost);
  SetStatus(is_fresh_ & (cost_ <= goal_.level), kLaneLowEnough);
  SetStatus(is_fresh_ & ~(cost_ < HUGE_VAL), kLaneBehind);
}

// See LocalModel::IsMetricGood.
void Stepping::UpdateMetric() {
  metric_ = Load(descents_.metric);
  const Lanes3 x_metric = Load(descents_.x_metric);
  const Lanes change = QuadraticForm(metric_, x_ - x_metric);
  const LaneMask is_stale =
      is_running_ & (is_fresh_ | ~(change <= kMetricReach * cost_));
  is_far_ = is_stale & ~is_stale;
  if (!Any(is_stale)) return;
  Lanes depth;
  const LaneMatrix metric =
      MetricOfLanes(rows_, x_, cost_, Load(descents_.count), &depth);
  metric_ = Select(is_stale, metric, metric_);
  const Lanes depth_start =
      Select(is_fresh_, depth, Load(descents_.depth_start));
  is_far_ = is_stale & (depth > kNearby * depth_start);
  Store(depth_start, &descents_.depth_start);
  Store(Select(is_stale, x_, x_metric), &descents_.x_metric);
  Store(metric_, &descents_.metric);
}

// The first step of a cold start has H = curvature + G, and only its
// multipliers are used.
void Stepping::Minimize() {
  const LaneMatrix H = curvature_ + Select(is_cold_, 1, kappa_) * metric_;
  step_ = MinimizeLaneModel(pieces_, rows_.count,
                            InverseCholesky(H, kPivotRounding), cost_,
                            is_running_, &hull_);
  is_solved_ = is_running_ & ~step_.is_open;
  UpdateMultipliers();
}

void Stepping::UpdateMultipliers() {
  Lanes sum = 0;
  for (int a = 0; a < kCorners; ++a) {
    const LaneCorner& corner = hull_.corner[a];
    multiplier_[a] = Select(corner.index >= 0, corner.weight, 0);
    sum += multiplier_[a];
  }
  bears_ = is_solved_ & (sum > kSmallestWeight);
  has_grown_ = bears_ & ~bears_;
  for (int a = 0; a < kCorners; ++a) {
    multiplier_[a] = Select(bears_, multiplier_[a] / sum, 0);
    has_grown_ =
        has_grown_ | (multiplier_[a] >
                      kMuchGrowth * hull_.corner[a].multiplier + kLeastGrowth);
  }
}

// See LocalModel::ShareOf.
void Stepping::Try() {
  const Lanes fall = FallOfLanes(rows_, pieces_, step_.d);
  share_ =
      Select(fall > kSmallFall, Min(1 / (1 + fall), kLargestFall / fall), 1);
  x_trial_ = x_ + share_ * step_.d;
  cost_trial_ = EvaluateLanes(rows_, x_trial_);
}

// See Run in newton_descent.cc.
void Stepping::Decide() {
  const Lanes smallest_kappa = SmallestKappa(goal_.tolerance);
  const Lanes promise = cost_ - step_.level;
  const LaneMask is_whole = share_ == 1;
  const Lanes tolerance = Select(is_whole, goal_.tolerance, kFinestTolerance);
  const LaneMask promises_nothing = ~(promise > tolerance * cost_);
  const LaneMask proposes = is_solved_ & ~is_cold_;
  const LaneMask lowers_kappa =
      proposes & promises_nothing & (kappa_ > smallest_kappa) & (lessons_ == 0);
  const LaneMask tries = proposes & ~lowers_kappa;

  const Lanes kept = (cost_ - cost_trial_) / (share_ * promise);
  const LaneMask is_newton = is_whole & (kappa_ <= smallest_kappa);
  const Lanes left = Max(cost_trial_ - step_.level, step_.held_back);
  const LaneMask is_rounding =
      ~(kept > kSufficientShare) & (promise <= kPromiseRounding * cost_);
  const LaneMask leaves_nothing =
      is_newton & ((left <= goal_.tolerance * cost_) | is_rounding);
  const LaneMask ends = tries & (promises_nothing | leaves_nothing);
  const LaneMask accepts = tries & ~ends & (kept > kSufficientShare);
  const LaneMask moves = accepts | (ends & (cost_trial_ < cost_));

  Learn(tries & ~ends & ~accepts);
  lessons_ = Select(accepts, 0, lessons_);
  cost_failed_ = Select(accepts, HUGE_VAL, cost_failed_);
  kappa_ = Select(accepts & (kept > kGoodShare),
                  Max(kKappaFall * kappa_, smallest_kappa), kappa_);
  kappa_ = Select(lowers_kappa, smallest_kappa, kappa_);
  adopts_ = bears_ & (accepts | is_cold_);
  x_ = Select(moves, x_trial_, x_);
  cost_ = Select(moves, cost_trial_, cost_);

  const Lanes iterations = Load(descents_.iterations) + Flag(proposes);
  Store(iterations, &descents_.iterations);
  const Lanes calls = Load(descents_.calls) + 1;
  Store(calls, &descents_.calls);
  Store(Flag(is_cold_ & ~is_solved_), &descents_.is_cold);
  // A lane gives up after 25 steps, as problems that take so many need more
  // than twice as many, or converge faster with tangents; and after 60 calls,
  // in which its active set changes without an end.
  const Lanes max_steps = Min(goal_.max_iterations, 25);
  SetStatus(is_running_ & ((kappa_ > kLargestKappa) | (calls >= 60) |
                           (iterations >= max_steps)),
            kLaneGivesUp);
  SetStatus(accepts & (cost_ <= goal_.sufficient), kLaneLowEnough);
  SetStatus(accepts & (cost_ <= kZeroPixels), kLaneZeroCost);
  SetStatus(ends, kLaneStationary);
  const LaneMask is_number = promise - promise == 0;
  SetStatus(is_running_ & (is_far_ | (is_solved_ & ~is_number)), kLaneGivesUp);
}

// See Learn in newton_descent.cc; here without tangents.
void Stepping::Learn(const LaneMask& learns) {
  const LaneMask is_worth_it = has_grown_ & (lessons_ < kMaxLessons) &
                               (cost_trial_ < kLessonWorth * cost_failed_);
  const LaneMask learned = learns & is_worth_it;
  lessons_ = Select(learned, lessons_ + 1, lessons_);
  kappa_ = Select(learns & ~learned, kKappaRise * kappa_, kappa_);
  cost_failed_ = Select(learns, cost_trial_, cost_failed_);
}

void Stepping::StoreDescents() {
  Store(status_, &descents_.status);
  Store(cost_, &descents_.cost);
  Store(kappa_, &descents_.kappa);
  Store(lessons_, &descents_.lessons);
  Store(cost_failed_, &descents_.cost_failed);
  Store(x_, &descents_.x);
  Store(Flag(~adopts_), &descents_.raises);
  for (int a = 0; a < kCorners; ++a) {
    Store(hull_.corner[a].index, &descents_.index[a]);
    Store(hull_.corner[a].weight, &descents_.weight[a]);
    Store(multiplier_[a], &descents_.multiplier[a]);
  }
}

void StepLanes(const LaneRow* rows, int num_rows, const LaneGoal& goal,
               LaneDescents* descents, LanePiece* pieces) {
  Stepping({rows, num_rows}, goal, descents, pieces).Run();
}

}  // namespace

// With two numbers per vector, lanes are slower than one problem after the
// other.
extern const LaneKernels kLaneKernels = {kVectorLanes >= 4, &StepLanes};

}  // namespace krot::internal::KROT_UNITS
