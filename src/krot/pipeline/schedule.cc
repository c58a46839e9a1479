#include "krot/pipeline/schedule.h"

#include <utility>

#include "krot/pipeline/iteration_log.h"
#include "krot/pipeline/start.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/block_sweep.h"

namespace krot {
namespace {

// Sweeps behind the joint solver: after them a third would hardly lower any
// block's own maximum.
constexpr int kFinishingSweeps = 2;
// What a finishing sweep may add to the cost by rounding, relative.
constexpr double kCostRounding = 1e-12;
// Leaves room in the gap for finishing sweeps' and the gauge's rounding.
constexpr double kShareOfGap = 0.999;

SolveTermination FromResInt(ResIntTermination termination) {
  switch (termination) {
    case ResIntTermination::kStalled:
      return SolveTermination::kStalled;
    case ResIntTermination::kMaxSweeps:
      return SolveTermination::kMaxSweeps;
    case ResIntTermination::kInterrupted:
      return SolveTermination::kInterrupted;
    case ResIntTermination::kNotRun:
      break;
  }
  return SolveTermination::kNotRun;
}

SolveTermination FromJoint(JointTermination termination) {
  switch (termination) {
    case JointTermination::kGapReached:
      return SolveTermination::kGapReached;
    case JointTermination::kMaxIterations:
      return SolveTermination::kMaxIterations;
    case JointTermination::kStalled:
      return SolveTermination::kStalled;
    case JointTermination::kInterrupted:
      return SolveTermination::kInterrupted;
    case JointTermination::kNotRun:
      break;
  }
  return SolveTermination::kNotRun;
}

class Schedule {
 public:
  Schedule(const KnownRotationProblem& problem,
           const SolveModelOptions& options, const Context& context,
           const Timer& timer, Estimate* estimate, SolveSummary* summary)
      : problem_(problem),
        options_(options),
        context_(context),
        timer_(timer),
        estimate_(*estimate),
        summary_(*summary) {}

  void Sweeps(ResIntOptions res_int);
  void LeadingSweeps();
  std::optional<Certificate> Joint();
  void FinishingSweeps();
  // Leaves an estimate that is still worse than a start found from nothing.
  void StartAfresh();

  bool IsInterrupted() const {
    return summary_.termination == SolveTermination::kInterrupted;
  }

 private:
  void AddSweep(double cost) {
    summary_.sweeps.push_back({cost, timer_.Seconds()});
    if (!options_.res_int.callback) return;
    options_.res_int.callback(static_cast<int>(summary_.sweeps.size()),
                              summary_.sweeps.back());
  }

  const KnownRotationProblem& problem_;
  const SolveModelOptions options_;
  const Context context_;
  const Timer& timer_;
  Estimate& estimate_;
  SolveSummary& summary_;
};

void Schedule::Sweeps(ResIntOptions res_int) {
  res_int.norm = options_.norm;
  res_int.callback = [this](int, const Sweep& sweep) { AddSweep(sweep.cost); };
  const ResIntSummary result =
      SolveResInt(problem_, res_int, context_, &estimate_);
  summary_.termination = FromResInt(result.termination);
  summary_.cost_final = result.cost_final;
}

void Schedule::LeadingSweeps() {
  ResIntOptions res_int = options_.res_int;
  res_int.max_sweeps = options_.max_leading_sweeps;
  res_int.sweep_tolerance = options_.leading_sweep_tolerance;
  res_int.patience = 1;
  Sweeps(res_int);
}

std::optional<Certificate> Schedule::Joint() {
  JointOptions joint = options_.joint;
  joint.norm = options_.norm;
  joint.relative_gap *= kShareOfGap;
  joint.callback = LogIterations(options_.joint.callback, timer_, &summary_);
  const JointSummary result = SolveJoint(problem_, joint, context_, &estimate_);
  summary_.termination = FromJoint(result.termination);
  summary_.cost_final = result.cost_final;
  summary_.num_working_observations = result.num_working_observations;
  return result.certificate;
}

void Schedule::FinishingSweeps() {
  BlockSweep blocks(problem_, options_.res_int.fast_descent, options_.norm,
                    context_);
  for (int sweep = 0; sweep < kFinishingSweeps; ++sweep) {
    Estimate swept = estimate_;
    blocks.IntersectPoints(&swept);
    blocks.ResectFrames(&swept);
    if (context_.IsCancelled()) {
      summary_.termination = SolveTermination::kInterrupted;
      return;
    }
    const double cost =
        Cost(problem_, swept, options_.norm, context_.num_threads);
    if (!(cost <= (1 + kCostRounding) * summary_.cost_final)) return;
    estimate_ = std::move(swept);
    summary_.cost_final = cost;
    AddSweep(cost);
  }
}

void Schedule::StartAfresh() {
  if (!(summary_.cost_final > options_.init_max_error)) return;
  context_.Note("the start is a rough one; looking for a better");
  FoundStart found = FindFeasibleStart(
      problem_, options_, context_,
      LogIterations(options_.joint.callback, timer_, &summary_));
  if (found.termination == SolveTermination::kInterrupted) {
    summary_.termination = SolveTermination::kInterrupted;
  }
  if (!found.estimate) return;
  const double cost =
      Cost(problem_, *found.estimate, options_.norm, context_.num_threads);
  if (!(cost < summary_.cost_final)) return;
  estimate_ = *std::move(found.estimate);
  summary_.cost_final = cost;
}

}  // namespace

std::optional<Certificate> RunSchedule(const KnownRotationProblem& problem,
                                       const SolveModelOptions& options,
                                       SolveMethod method,
                                       const Context& context,
                                       const Timer& timer, Estimate* estimate,
                                       SolveSummary* summary) {
  summary->cost_initial =
      Cost(problem, *estimate, options.norm, context.num_threads);
  summary->cost_final = summary->cost_initial;
  if (method != SolveMethod::kResInt &&
      IsZeroUpToRounding(summary->cost_initial)) {
    summary->termination = SolveTermination::kZeroCost;
    return std::nullopt;
  }
  Schedule schedule(problem, options, context, timer, estimate, summary);
  switch (method) {
    case SolveMethod::kResInt:
      schedule.Sweeps(options.res_int);
      return std::nullopt;
    case SolveMethod::kJoint:
      return schedule.Joint();
    case SolveMethod::kAuto:
      break;
  }
  schedule.LeadingSweeps();
  if (!schedule.IsInterrupted()) schedule.StartAfresh();
  if (schedule.IsInterrupted()) return std::nullopt;
  const std::optional<Certificate> certificate = schedule.Joint();
  if (!schedule.IsInterrupted()) schedule.FinishingSweeps();
  return certificate;
}

}  // namespace krot
