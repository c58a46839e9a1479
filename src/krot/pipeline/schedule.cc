#include "krot/pipeline/stages.h"

#include <utility>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

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
        summary_(*summary),
        cost_(MaxOfRanks(context, Cost(problem, *estimate, options.norm,
                                       context.num_threads))) {}

  void Sweeps(ResIntOptions res_int);
  void LeadingSweeps();
  std::optional<Certificate> Joint(KnownMultipliers* known);
  // If the cost is above init_max_error: looks for a start from nothing, and
  // takes it if it is better.
  void StartAfresh();

  double cost() const { return cost_; }
  bool IsZero() const { return IsZeroUpToRounding(cost_); }
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
  double cost_;  // of the rows, pixels
};

void Schedule::Sweeps(ResIntOptions res_int) {
  res_int.norm = options_.norm;
  res_int.callback = [this](int, const Sweep& sweep) { AddSweep(sweep.cost); };
  RunStep(
      options_.checkpoint, context_,
      [&] {
        const ResIntSummary result =
            SolveResInt(problem_, res_int, context_, &estimate_);
        summary_.termination = result.termination;
        cost_ = result.cost_final;
      },
      [&](StepValues* values) {
        NameValues(values, &estimate_);
        values->Value(&summary_.termination);
        values->Value(&cost_);
        values->Values(&summary_.sweeps);
      });
}

void Schedule::LeadingSweeps() {
  ResIntOptions res_int = options_.res_int;
  res_int.max_sweeps = options_.max_leading_sweeps;
  res_int.sweep_tolerance = options_.leading_sweep_tolerance;
  res_int.patience = 1;
  Sweeps(res_int);
}

std::optional<Certificate> Schedule::Joint(KnownMultipliers* known) {
  JointOptions joint = options_.joint;
  joint.norm = options_.norm;
  joint.relative_gap *= 0.9;  // the rest is for lenses and the gauge
  joint.checkpoint = options_.checkpoint;
  joint.callback = LogIterations(options_.joint.callback, timer_, &summary_);
  const JointSummary result =
      SolveJoint(problem_, joint, context_, &estimate_, known);
  summary_.termination = result.termination;
  cost_ = result.cost_final;
  summary_.num_working_observations = result.num_working_observations;
  return result.certificate;
}

void Schedule::StartAfresh() {
  if (!(cost_ > options_.init_max_error)) return;
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
  if (!(cost < cost_)) return;
  estimate_ = *std::move(found.estimate);
  cost_ = cost;
}

}  // namespace

std::optional<Certificate> SolveRows(
    const KnownRotationProblem& problem, const SolveModelOptions& options,
    SolveMethod method, bool is_first_round,
    const std::function<bool(const Estimate& swept, double linear_cost)>&
        have_rows_served,
    const Context& context, const Timer& timer, Estimate* estimate,
    KnownMultipliers* known, SolveSummary* summary) {
  Schedule schedule(problem, options, context, timer, estimate, summary);
  switch (method) {
    case SolveMethod::kResInt: {
      ResIntOptions res_int = options.res_int;
      if (!is_first_round && res_int.update_frames) {
        res_int.max_sweeps -= static_cast<int>(summary->sweeps.size());
      }
      schedule.Sweeps(res_int);
      return std::nullopt;
    }
    case SolveMethod::kJoint:
      return schedule.Joint(known);
    case SolveMethod::kAuto:
      break;
  }
  schedule.LeadingSweeps();
  if (is_first_round && !schedule.IsInterrupted()) schedule.StartAfresh();
  if (schedule.IsInterrupted()) return std::nullopt;
  if (schedule.IsZero()) {
    summary->termination = SolveTermination::kZeroCost;
    return std::nullopt;
  }
  if (have_rows_served && have_rows_served(*estimate, schedule.cost())) {
    summary->termination = SolveTermination::kStalled;
    return std::nullopt;
  }
  return schedule.Joint(known);
}

}  // namespace krot::internal
