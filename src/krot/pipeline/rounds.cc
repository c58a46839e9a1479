#include "krot/pipeline/stages.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "krot/convert/reprojection.h"
#include "krot/pipeline/rounds.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"

namespace krot::internal {
namespace {

// If sweeps have lowered the true cost to this share of what it was, and the
// rows' cost is at most this share of the true one, the rows no longer describe
// the true errors and are taken anew.
constexpr double kFarFromRows = 0.5;

class Rounds {
 public:
  Rounds(const SolveRun& run, BuiltProblem* built, Estimate* estimate,
         SolveSummary* summary)
      : model_(run.model),
        options_(run.options),
        rows_options_(run.options),
        method_(run.method),
        context_(run.context),
        timer_(run.timer),
        reprojection_(run.model, *built),
        built_(*built),
        estimate_(*estimate),
        summary_(*summary),
        positions_(model_, options_, context_, reprojection_, estimate_, built),
        cost_(LevelledCost(estimate_)),
        sufficient_cost_(SufficientCost(options_, method_)),
        bounds_{options_.joint.relative_gap} {
    if (positions_.Any()) {
      rows_options_.joint.relative_gap *= 0.05;
    }
  }

  void Run() {
    summary_.cost_initial = PixelCost();
    if (method_ != SolveMethod::kResInt && IsZeroUpToRounding(ReachedCost())) {
      summary_.termination = SolveTermination::kZeroCost;
      summary_.cost_final = ReachedCost();
      return;
    }
    reprojection_.TakeRows(estimate_, context_.num_threads, &built_.problem);
    while (RunOne() && summary_.rounds.size() < 30) {
    }
    if (IsRefuted()) return;
    if (IsSufficient(cost_) && !IsInterrupted()) {
      summary_.cost_final = cost_;
      summary_.termination = SolveTermination::kWithinBound;
      return;
    }
    if (!certificate() && !IsInterrupted()) Prove();
    if (std::isfinite(positions_.cost())) {
      estimate_ = positions_.estimate();
      reprojection_.TakeRows(estimate_, context_.num_threads, &built_.problem);
    }
    summary_.cost_final = cost_ = PixelCost();
    if (IsZeroUpToRounding(cost_) && method_ != SolveMethod::kResInt &&
        !IsInterrupted()) {
      summary_.termination = SolveTermination::kZeroCost;
    } else if (IsGapReached() && !IsInterrupted()) {
      summary_.termination = SolveTermination::kGapReached;
    } else if (summary_.termination == SolveTermination::kGapReached ||
               summary_.termination == SolveTermination::kZeroCost ||
               summary_.termination == SolveTermination::kNotRun) {
      summary_.termination =
          SolveTermination::kStalled;  // only rows reached it
    }
  }

  const std::optional<PixelCertificate>& certificate() const {
    return bounds_.proof;
  }

 private:
  double TrueCost(const Estimate& estimate) const {
    return MaxOfRanks(context_, reprojection_.TrueCost(estimate, options_.norm,
                                                       context_.num_threads));
  }
  double LevelledCost(const Estimate& estimate) const {
    return MaxOfRanks(context_,
                      reprojection_.LevelledCost(estimate, options_.norm,
                                                 context_.num_threads));
  }
  double PixelCost() const {
    return positions_.Any() ? TrueCost(estimate_) : cost_;
  }
  double RowsCost(const KnownRotationProblem& rows,
                  const Estimate& estimate) const {
    return MaxOfRanks(
        context_, Cost(rows, estimate, options_.norm, context_.num_threads));
  }
  // The cost of what would be returned now.
  double ReachedCost() const {
    return positions_.Any() ? positions_.cost() : cost_;
  }
  bool IsGapReached() const { return bounds_.IsGapReached(ReachedCost()); }
  bool IsRefuted() const {
    return summary_.termination == SolveTermination::kInfeasible;
  }
  bool IsInterrupted() const {
    return summary_.termination == SolveTermination::kInterrupted;
  }
  // Whether the limit of sweeps or iterations is reached. If only points move,
  // every round is allowed its own sweep.
  bool IsUsedUp() const {
    return summary_.termination == SolveTermination::kMaxIterations ||
           (summary_.termination == SolveTermination::kMaxSweeps &&
            options_.res_int.update_frames);
  }

  bool IsSufficient(double cost) const { return cost < sufficient_cost_; }

  // Whether sweeps came so far that solving the rows would be in vain: because
  // the cost is enough or near enough to a bound, or because the rows no longer
  // describe the true errors.
  bool HaveRowsServed(const Estimate& swept, double linear_cost) {
    if (positions_.Any()) return false;
    if (reprojection_.IsLinear() && sufficient_cost_ == 0) return false;
    const double cost = TrueCost(swept);
    if (IsSufficient(cost)) return true;
    if (reprojection_.IsLinear()) return false;
    is_bound_near_ = bounds_.IsNear(cost);
    return is_bound_near_ ||
           (cost <= kFarFromRows * cost_ && linear_cost <= kFarFromRows * cost);
  }

  // Runs a round. Returns whether another one may lower the cost.
  bool RunOne() {
    context_.Stage("lowering the largest error, round " +
                   std::to_string(summary_.rounds.size() + 1));
    const KnownRotationProblem& rows = built_.problem;
    std::optional<KnownRotationProblem> bounded;
    std::vector<int64_t> observation_of;
    const bool is_bounded = AnyRank(context_, !trust_.IsEmpty());
    if (is_bounded) {
      bounded = trust_.AddTo(rows, estimate_, cost_, &observation_of);
    }
    const KnownRotationProblem& problem = bounded ? *bounded : rows;
    // A depth that consists of rounding alone makes the rows useless: their
    // cost exceeds the true one where they were taken.
    const double rows_cost = RowsCost(problem, estimate_);
    if (!std::isfinite(rows_cost) ||
        (is_bounded && !positions_.Any() && rows_cost > (1 + 1e-3) * cost_)) {
      return false;
    }
    Estimate solved = estimate_;
    is_bound_near_ = false;
    std::optional<Certificate> of_these = SolveRows(
        problem, {model_, rows_options_, method_, context_, timer_},
        [this](const Estimate& swept, double linear_cost) {
          return HaveRowsServed(swept, linear_cost);
        },
        &solved, bounded ? nullptr : &known_multipliers_, &summary_);
    if (options_.res_int.update_frames) {
      RestoreGaugeIfHarmless(rows, estimate_, options_.norm, context_, &solved);
    }

    Round round;
    round.linear_cost = RowsCost(rows, solved);
    if (of_these && !is_bounded) {
      round.linear_lower_bound = of_these->lower_bound;
    }
    if (!is_bound_near_) {
      bounds_.rows.reset();
      if (of_these) {
        bounds_.rows = {*std::move(of_these), std::move(observation_of)};
      }
    }
    const double before = cost_;
    Estimate from = std::exchange(estimate_, Estimate());
    if (options_.res_int.update_frames) {
      estimate_ = BestOnSegment(reprojection_, from, solved, options_.norm,
                                context_, &round.step);
    } else {
      estimate_ = BestPointsOnSegments(reprojection_, rows, from, solved,
                                       options_.norm, context_.num_threads);
      round.step = 1;
    }
    cost_ = LevelledCost(estimate_);
    int64_t num_bounded = 0;
    if (round.step < 1) {
      // Rounding does not break a row's promise.
      num_bounded =
          SumOfRanks(context_, trust_.Shrink(reprojection_, rows, from, solved,
                                             options_.norm,
                                             (1 + 1e-5) * round.linear_cost));
    } else {
      trust_.Clear();
    }
    reprojection_.TakeRows(estimate_, context_.num_threads, &built_.problem);
    const bool has_level = positions_.Any() && TakeLevel(round.linear_cost);
    const bool is_tried =
        !has_level && !IsRefuted() && bounds_.IsWorthProving(cost_);
    if (is_tried) Prove();

    round.cost = PixelCost();
    if (certificate()) round.lower_bound = certificate()->lower_bound;
    round.seconds = timer_.Seconds();
    summary_.rounds.push_back(round);
    // The published algorithms solve one linear problem only.
    const bool is_as_in_paper =
        options_.res_int.fast_descent.settings == FastDescentSettings::kPaper;
    if (reprojection_.IsLinear() || is_as_in_paper || IsUsedUp() ||
        IsRefuted() || IsInterrupted() || IsGapReached() ||
        IsSufficient(cost_) || IsZeroUpToRounding(cost_)) {
      return false;
    }
    if (has_level || is_bound_near_) return true;
    // Where a proof for the rows has reached the gap, another round could lower
    // the cost by no more than that, and lenses would bend no less.
    if (is_tried && round.linear_lower_bound &&
        cost_ - *round.linear_lower_bound <= bounds_.relative_gap * cost_) {
      return false;
    }
    const bool is_idle = !(cost_ < (1 - 1e-6) * before);
    num_idle_rounds_ = is_idle ? num_idle_rounds_ + 1 : 0;
    if (round.linear_cost <= kFarFromRows * cost_) known_multipliers_ = {};
    // One idle round is enough without trust regions. It is enough, too, if the
    // cost is near the rows' bound but that proves nothing in true pixels: then
    // the estimate is a local minimum only.
    if (num_bounded == 0 || (is_tried && !certificate())) return !is_idle;
    return num_idle_rounds_ < 3;
  }

  // Tries to prove a bound in true pixels from the last round's certificate of
  // the rows, which is used up: each is tried once.
  void Prove() {
    const auto rows = std::exchange(bounds_.rows, std::nullopt);
    if (!rows) return;
    context_.Stage("proving the bound in true pixels");
    const double sufficient = bounds_.Sufficient(cost_);
    bounds_.Improve(
        positions_.Any()
            ? positions_.Prove(estimate_, SupportOf(*rows), sufficient)
            : ProveRows(model_, built_, estimate_, options_, *rows, sufficient,
                        context_));
  }

  // Where positions are known: whether the next round has another level. Ends
  // the solve as kInfeasible if no estimate that keeps the positions is good
  // enough.
  bool TakeLevel(double optimum) {
    positions_.Keep(estimate_);
    if (const auto& rows = bounds_.rows) {
      std::optional<PixelCertificate> refutation =
          positions_.Refute(estimate_, rows->certificate, SupportOf(*rows));
      if (refutation) {
        bounds_.proof = std::move(refutation);
        summary_.termination = SolveTermination::kInfeasible;
        return false;
      }
    }
    bool is_held_back = false;
    if (bounds_.rows) {
      for (const int64_t i : SupportOf(*bounds_.rows)) {
        is_held_back = is_held_back || !reprojection_.IsOfModel(i);
      }
    }
    const bool is_another =
        positions_.TakeLevel(estimate_, optimum, cost_, is_held_back);
    if (is_another) cost_ = LevelledCost(estimate_);
    return is_another;
  }

  const Model& model_;
  const SolveModelOptions& options_;
  SolveModelOptions rows_options_;  // for SolveRows
  const SolveMethod method_;
  const Context& context_;
  const Timer& timer_;
  const Reprojection reprojection_;
  BuiltProblem& built_;
  Estimate& estimate_;
  SolveSummary& summary_;
  KeptPositions positions_;
  double cost_;  // LevelledCost of the estimate, pixels
  const double sufficient_cost_;
  TrustRegions trust_;
  int num_idle_rounds_ = 0;
  RoundBounds bounds_;
  // Whether the sweeps of this round alone have brought the cost near enough to
  // the bound of an earlier round.
  bool is_bound_near_ = false;
  // From the last round without trust regions, to warm-start the next one.
  KnownMultipliers known_multipliers_;
};

}  // namespace

std::optional<PixelCertificate> SolveInRounds(const SolveRun& run,
                                              BuiltProblem* built,
                                              Estimate* estimate,
                                              SolveSummary* summary) {
  Rounds rounds(run, built, estimate, summary);
  rounds.Run();
  return rounds.certificate();
}

}  // namespace krot::internal
