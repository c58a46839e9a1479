#include "krot/pipeline/stages.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/convert/reprojection.h"
#include "krot/joint/joint.h"
#include "krot/pipeline/rounds.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

class Schedule {
 public:
  Schedule(const KnownRotationProblem& problem, const SolveRun& run,
           Estimate* estimate, SolveSummary* summary)
      : problem_(problem),
        options_(run.options),
        context_(run.context),
        timer_(run.timer),
        estimate_(*estimate),
        summary_(*summary),
        cost_(MaxOfRanks(context_, Cost(problem, *estimate, options_.norm,
                                        context_.num_threads))) {}

  void Sweeps(ResIntOptions res_int) {
    res_int.norm = options_.norm;
    res_int.callback = [this](int, const Sweep& sweep) {
      AddSweep(sweep.cost);
    };
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

  void LeadingSweeps() {
    ResIntOptions res_int = options_.res_int;
    res_int.max_sweeps = options_.max_leading_sweeps;
    res_int.sweep_tolerance = options_.leading_sweep_tolerance;
    res_int.patience = 1;
    Sweeps(res_int);
  }

  std::optional<Certificate> Joint(KnownMultipliers* known) {
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
  const SolveModelOptions& options_;
  const Context& context_;
  const Timer& timer_;
  Estimate& estimate_;
  SolveSummary& summary_;
  double cost_;  // of the rows, pixels
};

}  // namespace

std::optional<Certificate> SolveRows(
    const KnownRotationProblem& problem, const SolveRun& run,
    const std::function<bool(const Estimate& swept, double linear_cost)>&
        have_rows_served,
    Estimate* estimate, KnownMultipliers* known, SolveSummary* summary) {
  Schedule schedule(problem, run, estimate, summary);
  switch (run.method) {
    case SolveMethod::kResInt: {
      ResIntOptions res_int = run.options.res_int;
      if (res_int.update_frames) {
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

double SufficientCost(const SolveModelOptions& options, SolveMethod method) {
  const bool is_asked = options.find_lowest || method != SolveMethod::kAuto ||
                        options.finish.finish != Finish::kLeastSquares ||
                        !options.problem.positions.empty();
  return is_asked ? 0 : (1 - kLeastRoom) * options.finish.max_error.value_or(0);
}

const char* FinishName(Finish finish) {
  return finish == Finish::kNone ? "none" : "least_squares";
}

namespace {

BundleAdjustmentOptions PolishOptions(Polish polish, const ErrorLoss& loss) {
  BundleAdjustmentOptions options;
  options.loss = loss.kind == ErrorLoss::Kind::kHuber    ? RobustLoss::kHuber
                 : loss.kind == ErrorLoss::Kind::kCauchy ? RobustLoss::kCauchy
                                                         : RobustLoss::kTrivial;
  options.loss_scale = loss.scale;
  if (polish == Polish::kFull) return options;
  options.constant_rig_from_world_rotation = true;
  options.refine_sensor_from_rig = false;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  return options;
}

}  // namespace

PolishSummary PolishModel(Polish polish, const ErrorLoss& loss,
                          const FixedParts& fixed, const Context& context,
                          Model* model) {
  BundleAdjustmentOptions options = PolishOptions(polish, loss);
  options.fixed = fixed;
  BundleAdjustmentResult adjusted = AdjustBundle(*model, options, context);
  const std::vector<double> errors_px =
      PixelErrors(adjusted.model, context.num_threads);
  UpdatePointErrors(errors_px, &adjusted.model);
  *model = std::move(adjusted.model);
  return {polish, std::move(adjusted.summary), Summarize(errors_px)};
}

const char* PolishName(Polish polish) {
  return polish == Polish::kFull             ? "full"
         : polish == Polish::kRotationsFixed ? "rotations_fixed"
                                             : "none";
}

namespace {

void FinishByLeastSquares(const SolveRun& run,
                          std::optional<double> lower_bound,
                          BuiltProblem* built, Estimate* estimate,
                          SolveSummary* summary) {
  const SolveModelOptions& options = run.options;
  const Context& context = run.context;
  const Reprojection reprojection(run.model, *built);
  const Timer timer;
  FinishSummary finish;
  finish.lowest_cost = summary->cost_final;
  finish.loss = options.finish.loss;
  // If the gap leaves too little room above the proved bound, the cap is based
  // on the maximum that was reached.
  const double largest_gap =
      std::min(options.joint.relative_gap, options.finish.slack / 2);
  const bool is_lowest_known =
      lower_bound &&
      finish.lowest_cost - *lower_bound <= largest_gap * finish.lowest_cost;
  const double lowest = is_lowest_known ? *lower_bound : finish.lowest_cost;
  // Where positions are known, the start need not keep them, so its largest
  // error is no limit.
  const double highest =
      built->positions.empty() ? summary->cost_initial : kInfinity;
  finish.cap = options.finish.max_error.value_or(
      std::min((1 + options.finish.slack) * lowest, highest));
  if (!(finish.lowest_cost < (1 - kLeastRoom) * finish.cap) ||
      LargestPositionRatio(*built, *estimate) > 1 + kKeptInRounds) {
    return;
  }

  BoundedOptions bounded;
  bounded.norm = options.norm;
  bounded.cap = (1 - 1e-7) * finish.cap;  // rounding may raise an error
  bounded.loss = options.finish.loss;
  bounded.callback = options.finish.callback;
  bounded.num_views = static_cast<int32_t>(built->image_of.size());
  // More of the tolerance than rounds use: the finish starts strictly inside.
  built->position_level = bounded.cap / (1 + 0.75 * kKeptPosition);
  TakePositionRows(*built, *estimate, &built->problem);
  if (!reprojection.IsLinear()) {
    bounded.take_rows = [&](const Estimate& x) {
      return reprojection.TakeRows(x, context.num_threads, &built->problem);
    };
  }
  Estimate finished = *estimate;
  RunStep(
      options.checkpoint, context,
      [&] {
        finish.solve =
            MinimizeBounded(built->problem, bounded, context, &finished);
      },
      [&](StepValues* values) {
        values->Value(&finish.solve);
        NameValues(values, &finished);
      });
  const double cost = MaxOfRanks(
      context,
      reprojection.TrueCost(finished, options.norm, context.num_threads));
  if (cost <= finish.cap &&
      LargestPositionRatio(*built, finished) <= 1 + kKeptPosition) {
    *estimate = std::move(finished);
    summary->cost_final = cost;
    finish.seconds = timer.Seconds();
    summary->finish = finish;
  }
  reprojection.TakeRows(*estimate, context.num_threads, &built->problem);
}

}  // namespace

void RunFinish(const SolveRun& run, std::optional<double> lower_bound,
               BuiltProblem* built, Estimate* estimate, SolveSummary* summary) {
  if (run.options.finish.finish == Finish::kNone) return;
  if (!IsZeroUpToRounding(summary->cost_final)) {
    FinishByLeastSquares(run, lower_bound, built, estimate, summary);
  }
  if (run.context.IsCancelled()) {
    summary->termination = SolveTermination::kInterrupted;
  }
}

double SumOfLosses(const Reprojection& reprojection,
                   const KnownRotationProblem& problem, const ErrorLoss& loss,
                   const Estimate& estimate, const Context& context) {
  std::vector<double> sum = {0};
  InTurnOfRanks(
      context,
      [&](std::vector<double>* of_whole) {
        for (size_t n = 0; n < problem.observations.size(); ++n) {
          const auto i = static_cast<int64_t>(n);
          if (!reprojection.IsOfModel(i)) continue;
          const double error = reprojection.Error(estimate, Norm::L2(), i);
          (*of_whole)[0] += 0.5 * loss.Value(error * error);
        }
      },
      &sum);
  return sum[0];
}

}  // namespace krot::internal
