#include "krot/pipeline/stages.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/convert/reprojection.h"
#include "krot/joint/joint.h"
#include "krot/pipeline/known_positions.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/cost.h"

namespace krot::internal {

const char* FinishName(Finish finish) {
  return finish == Finish::kNone ? "none" : "least_squares";
}

namespace {

RobustLoss LossOf(ErrorLoss::Kind kind) {
  switch (kind) {
    case ErrorLoss::Kind::kHuber:
      return RobustLoss::kHuber;
    case ErrorLoss::Kind::kCauchy:
      return RobustLoss::kCauchy;
    case ErrorLoss::Kind::kTrivial:
      break;
  }
  return RobustLoss::kTrivial;
}

BundleAdjustmentOptions PolishOptions(Polish polish, const ErrorLoss& loss) {
  BundleAdjustmentOptions options;
  options.loss = LossOf(loss.kind);
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
  switch (polish) {
    case Polish::kRotationsFixed:
      return "rotations_fixed";
    case Polish::kFull:
      return "full";
    case Polish::kNone:
      break;
  }
  return "none";
}

namespace {

// The cap is based on the proved bound only if the gap is at most this share of
// the slack: then there is room between the estimate and the cap.
constexpr double kShareOfSlack = 0.5;
// The finish stays this far below the cap, relative, as rounding may raise the
// largest error.
constexpr double kRounding = 1e-7;
// The share of the tolerance of positions that the finish may use. It is more
// than rounds use, so that the finish starts strictly inside.
constexpr double kShareOfKept = 0.75;

void FinishByLeastSquares(const Reprojection& reprojection,
                          const SolveModelOptions& options,
                          std::optional<double> lower_bound,
                          const Context& context, BuiltProblem* built,
                          Estimate* estimate, SolveSummary* summary) {
  const Timer timer;
  FinishSummary finish;
  finish.lowest_cost = summary->cost_final;
  finish.loss = options.finish.loss;
  // If the gap leaves too little room above the proved bound, the cap is based
  // on the maximum that was reached.
  const double largest_gap = std::min(options.joint.relative_gap,
                                      kShareOfSlack * options.finish.slack);
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
  bounded.cap = (1 - kRounding) * finish.cap;
  bounded.loss = options.finish.loss;
  bounded.callback = options.finish.callback;
  bounded.num_views = static_cast<int32_t>(built->image_of.size());
  built->position_level = bounded.cap / (1 + kShareOfKept * kKeptPosition);
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

void RunFinish(const Model& model, const SolveModelOptions& options,
               std::optional<double> lower_bound, const Context& context,
               BuiltProblem* built, Estimate* estimate, SolveSummary* summary) {
  if (options.finish.finish == Finish::kNone) return;
  if (!IsZeroUpToRounding(summary->cost_final)) {
    FinishByLeastSquares(Reprojection(model, *built), options, lower_bound,
                         context, built, estimate, summary);
  }
  if (context.IsCancelled()) {
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
