#include "krot/sweeps/res_int.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// The goal of blocks in coarse sweeps; see res_int.h. `gain` is the relative
// decrease of the cost by the last sweep. With a tolerance of 1e-2 throughout,
// alternation would end at a higher cost (docs/history/journal.md, "Res-Int,
// the first ten sweeps").
DescentGoal CoarseGoal(double gain, double cost) {
  return {std::clamp(0.1 * gain, 1e-3, 1e-2), cost / 2};
}

// Nesterov's momentum with restarts [Nesterov 1983; O'Donoghue, Candes 2015]:
// every sweep starts a little further along the last improvement. A sweep that
// ends above the best cost is discarded, so the best cost never rises.
//
// Alternation is slow along directions in which points and frames must move
// together; momentum goes faster along these.
class Momentum {
 public:
  // Starts at `start`, of cost `cost`; keeps a reference to `problem`.
  Momentum(const KnownRotationProblem& problem, const Context& context,
           const Estimate& start, double cost)
      : problem_(problem),
        context_(context),
        best_(start),
        previous_(start),
        best_cost_(cost) {}

  // The start of the next sweep: the best estimate, or one beyond it at which
  // all depths are positive.
  Estimate NextStart() {
    if (improvements_ == 0) return best_;
    double beta = improvements_ / (improvements_ + 3.0);
    for (int halving = 0; halving < 4; ++halving, beta /= 2) {
      Estimate start = Between(best_, previous_, -beta);
      if (AllRanks(context_,
                   AllDepthsPositive(problem_, start, context_.num_threads))) {
        return start;
      }
    }
    improvements_ = 0;
    return best_;
  }

  // Takes the result of the sweep from NextStart() unless it is worse. A result
  // of equal cost is taken, because blocks below the maximum may have improved.
  void Accept(const Estimate& reached, double cost) {
    const bool improves = cost < best_cost_;
    improvements_ = improves ? improvements_ + 1 : 0;
    if (!improves && cost != best_cost_) return;
    previous_ = std::move(best_);
    best_ = reached;
    best_cost_ = cost;
  }

  const Estimate& best() const { return best_; }
  double best_cost() const { return best_cost_; }

 private:
  const KnownRotationProblem& problem_;
  const Context context_;
  Estimate best_;
  Estimate previous_;  // the best one before it
  double best_cost_;
  int improvements_ = 0;  // since the last restart
};

void CheckOptions(const ResIntOptions& options) {
  CheckAtLeast(1, options.norm.p, "norm.p");
  CheckAtLeast(0, options.max_sweeps, "max_sweeps");
  CheckAtLeast(0, options.sweep_tolerance, "sweep_tolerance");
  CheckAtLeast(1, options.patience, "patience");
}

}  // namespace

ResIntSummary SolveResInt(const KnownRotationProblem& problem,
                          const ResIntOptions& options, const Context& context,
                          Estimate* estimate) {
  CheckOptions(options);
  const Timer timer;
  const bool literal =
      options.fast_descent.settings == FastDescentSettings::kPaper;
  const int patience = literal ? 1 : options.patience;
  ResIntSummary summary;
  const auto cost_of = [&](const Estimate& x) {
    return MaxOfRanks(context,
                      Cost(problem, x, options.norm, context.num_threads));
  };
  summary.cost_initial = cost_of(*estimate);
  CheckArgument(std::isfinite(summary.cost_initial), "cost of the start",
                summary.cost_initial, "finite: all depths positive");

  summary.termination = SolveTermination::kMaxSweeps;
  BlockSweep blocks(problem, options.fast_descent, options.norm, context);
  Momentum momentum(problem, context, *estimate, summary.cost_initial);
  bool is_coarse = !literal && options.update_frames;
  double gain = 1;      // of the last sweep, relative; 1 before the first
  int idle_sweeps = 0;  // in a row
  for (int sweep = 1; sweep <= options.max_sweeps; ++sweep) {
    const bool is_last = sweep == options.max_sweeps;
    Estimate current =
        literal || is_last ? momentum.best() : momentum.NextStart();
    blocks.SetGoal(is_coarse && !is_last
                       ? CoarseGoal(gain, momentum.best_cost())
                       : DescentGoal{});
    double reached = blocks.IntersectPoints(&current);
    if (options.update_frames) reached = blocks.ResectFrames(&current);
    if (context.IsCancelled()) {
      summary.termination = SolveTermination::kInterrupted;
      break;
    }
    const double cost_before = momentum.best_cost();
    momentum.Accept(current, reached);
    const double cost = momentum.best_cost();
    summary.sweeps.push_back({cost, timer.Seconds()});
    if (options.callback) options.callback(sweep, summary.sweeps.back());
    gain = (cost_before - cost) / cost_before;
    const bool idle = gain <= options.sweep_tolerance;
    idle_sweeps = idle ? idle_sweeps + 1 : 0;
    if (is_coarse && idle_sweeps == patience) {
      is_coarse = false;
      idle_sweeps = 0;
    }
    if (idle_sweeps == patience || cost == 0) {
      summary.termination = SolveTermination::kStalled;
      break;
    }
  }
  // The costs of sweeps differ from Cost() by rounding.
  summary.cost_final = cost_of(momentum.best());
  if (summary.cost_final <= summary.cost_initial) {
    *estimate = momentum.best();
  } else {
    summary.cost_final = summary.cost_initial;
  }
  return summary;
}

}  // namespace krot::internal
