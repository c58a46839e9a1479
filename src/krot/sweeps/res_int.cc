#include "krot/sweeps/res_int.h"

#include <algorithm>
#include <cmath>

#include "krot/base/check.h"
#include "krot/base/timer.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/block_sweep.h"
#include "krot/sweeps/momentum.h"

namespace krot {
namespace {

// How far coarse sweeps take a block: see res_int.h. A tolerance of 1e-2
// throughout, and alternation ends higher (docs/history/journal.md, "Res-Int,
// the first ten sweeps").
constexpr double kCoarseShareOfGain = 0.1;
constexpr double kFinestCoarse = 1e-3;
constexpr double kCoarsest = 1e-2;
constexpr double kCoarseLevel = 0.5;

// `gain`: by how much the last sweep lowered the cost, relative.
DescentGoal CoarseGoal(double gain, double cost) {
  return {std::clamp(kCoarseShareOfGain * gain, kFinestCoarse, kCoarsest),
          kCoarseLevel * cost};
}

void CheckOptions(const ResIntOptions& options) {
  CheckArgument(options.norm.p >= 1, "norm.p", options.norm.p, ">= 1");
  CheckArgument(options.max_sweeps >= 0, "max_sweeps", options.max_sweeps,
                ">= 0");
  CheckArgument(options.sweep_tolerance >= 0, "sweep_tolerance",
                options.sweep_tolerance, ">= 0");
  CheckArgument(options.patience >= 1, "patience", options.patience, ">= 1");
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
    return context.Max(Cost(problem, x, options.norm, context.num_threads));
  };
  summary.cost_initial = cost_of(*estimate);
  CheckArgument(std::isfinite(summary.cost_initial), "cost of the start",
                summary.cost_initial, "finite: all depths positive");

  summary.termination = ResIntTermination::kMaxSweeps;
  BlockSweep blocks(problem, options.fast_descent, options.norm, context);
  Momentum momentum(problem, context, *estimate, summary.cost_initial);
  bool is_coarse = !literal && options.update_frames;
  double gain = 1;      // of the last sweep, relative; of none, as if large
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
      summary.termination = ResIntTermination::kInterrupted;
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
      summary.termination = ResIntTermination::kStalled;
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

}  // namespace krot
