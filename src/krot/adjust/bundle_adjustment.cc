#include "krot/adjust/bundle_adjustment.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <memory>
#include <set>

#include <ceres/solver.h>
#include <glog/logging.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/ceres_problem.h"
#include "krot/adjust/precision_system.h"
#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

void CheckOptions(const BundleAdjustmentOptions& options) {
  CheckAtLeast(1, options.min_track_length, "min_track_length");
  CheckPositive(options.loss_scale, "loss_scale");
  CheckPositive(options.sigma_px.value_or(1), "sigma_px");
  CheckArgument(options.positions.empty() || options.sigma_px, "positions",
                options.positions.size(), "none without sigma_px");
  CheckArgument(options.distances.empty() || options.sigma_px, "distances",
                options.distances.size(), "none without sigma_px");
  CheckAtLeast(0, options.max_num_iterations, "max_num_iterations");
  CheckAtLeast(1, options.max_linear_solver_iterations,
               "max_linear_solver_iterations");
  CheckAtLeast(0, options.function_tolerance, "function_tolerance");
  CheckAtLeast(0, options.gradient_tolerance, "gradient_tolerance");
  CheckAtLeast(0, options.parameter_tolerance, "parameter_tolerance");
  CheckAtLeast(0, options.max_num_images_direct_dense,
               "max_num_images_direct_dense");
  CheckAtLeast(0, options.max_num_images_direct_sparse,
               "max_num_images_direct_sparse");
  if (!options.IsBounded()) return;
  CheckArgument(options.max_error.value_or(1) > 0, "max_error",
                *options.max_error, "> 0");
  CheckArgument(!options.max_error || !options.lower_max_error,
                "lower_max_error", options.lower_max_error,
                "false with a max_error");
  CheckArgument(options.loss == RobustLoss::kTrivial, "loss",
                static_cast<int>(options.loss), "trivial with a cap");
  CheckArgument(options.positions.empty(), "positions",
                options.positions.size(), "none with a cap");
  CheckArgument(options.distances.empty(), "distances",
                options.distances.size(), "none with a cap");
}

std::unique_ptr<ceres::LossFunction> MakeLoss(
    const BundleAdjustmentOptions& options) {
  switch (options.loss) {
    case RobustLoss::kSoftL1:
      return std::make_unique<ceres::SoftLOneLoss>(options.loss_scale);
    case RobustLoss::kCauchy:
      return std::make_unique<ceres::CauchyLoss>(options.loss_scale);
    case RobustLoss::kHuber:
      return std::make_unique<ceres::HuberLoss>(options.loss_scale);
    case RobustLoss::kTrivial:
      break;
  }
  return nullptr;
}

BundleAdjustmentTermination FromCeres(ceres::TerminationType type) {
  switch (type) {
    case ceres::CONVERGENCE:
      return BundleAdjustmentTermination::kConverged;
    case ceres::NO_CONVERGENCE:
      return BundleAdjustmentTermination::kMaxIterations;
    case ceres::USER_SUCCESS:
      return BundleAdjustmentTermination::kInterrupted;
    case ceres::FAILURE:
    case ceres::USER_FAILURE:
      break;
  }
  return BundleAdjustmentTermination::kStalled;
}

std::string SolverName(const ceres::Solver::Options& options) {
  std::string name =
      ceres::LinearSolverTypeToString(options.linear_solver_type);
  std::transform(name.begin(), name.end(), name.begin(), [](char letter) {
    return static_cast<char>(std::tolower(letter));
  });
  return name;
}

void Count(const AdjustmentBlocks& blocks, const AdjustmentColumns& columns,
           BundleAdjustmentSummary* summary) {
  std::set<int32_t> frames, points;
  for (const AdjustmentObservation& observation : blocks.observations) {
    frames.insert(observation.frame);
    points.insert(observation.point);
  }
  summary->num_frames = static_cast<int64_t>(frames.size());
  summary->num_points = static_cast<int64_t>(points.size());
  summary->num_images = blocks.num_images;
  summary->num_observations = static_cast<int64_t>(blocks.observations.size());
  summary->num_no_pose = blocks.num_no_pose;
  summary->num_behind = blocks.num_behind;
  summary->num_short_track = blocks.num_short_track;
  summary->num_parameters = columns.num_unknowns;
  summary->num_positions = static_cast<int64_t>(blocks.positions.size());
  for (const DistanceObservation& distance : blocks.distances) {
    if (distance.px_from_world == 0) continue;
    summary->distances.push_back(distance.index);
  }
}

// Half the sum of the squared errors, with the loss if there is one, and of the
// known positions' and distances'. None if an error is not finite or reaches
// the cap.
std::optional<double> RobustCost(const Context& context,
                                 const ceres::LossFunction* loss,
                                 const AdjustmentBlocks& blocks) {
  const auto errors =
      ProjectErrors(blocks, std::sqrt(blocks.cap2), context.num_threads);
  if (!errors) return std::nullopt;
  const double of_survey = HalfSquaredSurvey(blocks);
  if (loss == nullptr) return HalfSquaredNorm(*errors) + of_survey;
  double sum = 0;
  for (const ProjectedError& error : *errors) {
    double rho[3];
    loss->Evaluate(error.r.squaredNorm(), rho);
    sum += rho[0];
  }
  return sum / 2 + of_survey;
}

// The options with a callback that also adds the iterations to the summary.
BundleAdjustmentOptions RecordIterations(const BundleAdjustmentOptions& options,
                                         BundleAdjustmentSummary* summary) {
  BundleAdjustmentOptions recorded = options;
  recorded.callback = [summary, callback = options.callback](
                          const BundleAdjustmentIteration& iteration) {
    if (iteration.iteration > 0) summary->iterations.push_back(iteration);
    if (callback) callback(iteration);
  };
  return recorded;
}

double MedianError(const Context& context, const AdjustmentBlocks& blocks) {
  const auto errors = ProjectErrors(blocks, kInfinity, context.num_threads);
  std::vector<double> norms;
  norms.reserve(errors->size());
  for (const ProjectedError& error : *errors) norms.push_back(error.r.norm());
  return MedianOf(norms, context);
}

// Solves a problem without a cap, with the loss of the options.
void MinimizeLoss(const BundleAdjustmentOptions& options,
                  const Context& context, IterationObserver* observer,
                  AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary) {
  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(options);
  ceres::Problem problem(AdjustmentProblemOptions());
  BuildAdjustmentProblem(options, loss.get(), blocks, &problem);
  ceres::Solver::Options solver_options =
      AdjustmentSolverOptions(options, context, blocks, problem);
  summary->linear_solver = SolverName(solver_options);
  solver_options.callbacks.push_back(observer);
  ceres::Solver::Summary solve;
  ceres::Solve(solver_options, &problem, &solve);
  summary->termination = FromCeres(solve.termination_type);
  summary->num_iterations = observer->num_iterations();
  summary->cost_final = *RobustCost(context, loss.get(), *blocks);
  summary->stationarity =
      Stationarity(solver_options.num_threads, summary->cost_final, &problem);
}

// The same from where a loose solve with a wider loss ends (graduated
// non-convexity) [Blake, Zisserman, Visual Reconstruction, 1987].
void MinimizeFromWiderLoss(const BundleAdjustmentOptions& options,
                           double first_scale, const Context& context,
                           AdjustmentBlocks* blocks,
                           BundleAdjustmentSummary* summary) {
  IterationObserver observer(options.callback, context);
  BundleAdjustmentOptions stage = options;
  stage.loss_scale = first_scale;
  stage.function_tolerance = std::sqrt(options.function_tolerance);
  stage.max_num_iterations = options.max_num_iterations / 2;
  MinimizeLoss(stage, context, &observer, blocks, summary);
  stage = options;
  stage.max_num_iterations -= summary->num_iterations;
  MinimizeLoss(stage, context, &observer, blocks, summary);
  summary->first_loss_scale = first_scale;
}

// Cauchy's loss is not convex. Where most errors are above its scale, an image
// that is far off is hardly drawn, and stays; from a wider loss it comes, but
// then wrong observations may draw others away. So both are tried, and the
// lower cost is kept.
void MinimizeFromBoth(const BundleAdjustmentOptions& options,
                      const Context& context, AdjustmentBlocks* blocks,
                      BundleAdjustmentSummary* summary) {
  const auto minimize = [&] {
    IterationObserver observer(options.callback, context);
    MinimizeLoss(options, context, &observer, blocks, summary);
  };
  if (options.loss != RobustLoss::kCauchy) return minimize();
  const double median = MedianError(context, *blocks);
  if (!(median > options.loss_scale)) return minimize();
  AdjustmentBlocks wider_blocks = *blocks;
  BundleAdjustmentSummary wider = *summary;
  MinimizeFromWiderLoss(options, median, context, &wider_blocks, &wider);
  std::swap(wider.iterations, summary->iterations);
  minimize();
  if (wider.cost_final < summary->cost_final) {
    *blocks = std::move(wider_blocks);
    *summary = std::move(wider);
  }
}

// For each frame the error that a quarter of its observations exceed, pixels; 0
// without observations.
std::vector<double> UpperQuartiles(const Context& context,
                                   const AdjustmentBlocks& blocks) {
  const auto errors = ProjectErrors(blocks, kInfinity, context.num_threads);
  std::vector<std::vector<double>> of_frame(blocks.frames.size());
  for (size_t i = 0; i < errors->size(); ++i) {
    of_frame[blocks.observations[i].frame].push_back((*errors)[i].r.norm());
  }
  std::vector<double> quartiles;
  for (std::vector<double>& norms : of_frame) {
    if (norms.empty()) {
      quartiles.push_back(0);
      continue;
    }
    const auto quartile =
        norms.begin() + static_cast<int64_t>(3 * (norms.size() - 1) / 4);
    std::nth_element(norms.begin(), quartile, norms.end());
    quartiles.push_back(*quartile);
  }
  return quartiles;
}

// The part of the problem that a frame sees: it and its points may move, and
// all else is as it is.
AdjustmentBlocks PartAround(int32_t frame, const AdjustmentBlocks& blocks) {
  AdjustmentBlocks part = blocks;
  part.num_images = 1;
  part.frame_is_fixed.assign(part.frames.size(), 1);
  part.frame_is_fixed[frame] = 0;
  part.sensor_is_fixed.assign(part.sensors.size(), 1);
  std::vector<char> is_seen(part.points.size(), 0);
  for (const AdjustmentObservation& observation : blocks.observations) {
    if (observation.frame == frame) is_seen[observation.point] = 1;
  }
  for (size_t k = 0; k < is_seen.size(); ++k) {
    if (is_seen[k] == 0) part.point_is_fixed[k] = 1;
  }
  part.observations.erase(
      std::remove_if(part.observations.begin(), part.observations.end(),
                     [&](const AdjustmentObservation& observation) {
                       return is_seen[observation.point] == 0;
                     }),
      part.observations.end());
  return part;
}

// Moves a frame and its points from a loss of this scale to the options' own,
// which narrows step by step. Whether the cost falls by more than
// `least_gain`; if not, nothing moves.
bool MoveFrame(int32_t frame, const BundleAdjustmentOptions& options,
               double first_scale, double least_gain, const Context& context,
               AdjustmentBlocks* blocks) {
  AdjustmentBlocks part = PartAround(frame, *blocks);
  BundleAdjustmentOptions stage = options;
  stage.refine_sensor_from_rig = false;
  stage.refine_focal_length = false;
  stage.refine_principal_point = false;
  stage.refine_extra_params = false;
  const double before = *RobustCost(context, MakeLoss(options).get(), part);
  BundleAdjustmentSummary summary;
  for (double scale = first_scale;; scale /= 2) {
    stage.loss_scale = std::max(scale, options.loss_scale);
    IterationObserver observer(nullptr, context);
    MinimizeLoss(stage, context, &observer, &part, &summary);
    if (scale <= options.loss_scale) break;
  }
  if (!(summary.cost_final < before - least_gain)) return false;
  blocks->frames[frame] = part.frames[frame];
  blocks->points = std::move(part.points);
  return true;
}

// The same, and with Cauchy's loss frames with twice the median frame's errors
// are moved one by one, and then all once more.
void Minimize(const BundleAdjustmentOptions& options, const Context& context,
              AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary) {
  MinimizeFromBoth(options, context, blocks, summary);
  if (options.loss != RobustLoss::kCauchy || !options.refine_rig_from_world) {
    return;
  }
  context.Stage("looking for frames that are far off");
  const std::vector<double> quartiles = UpperQuartiles(context, *blocks);
  std::vector<double> of_seen = quartiles;
  of_seen.erase(std::remove(of_seen.begin(), of_seen.end(), 0), of_seen.end());
  const double median = MedianOf(of_seen, context);
  for (size_t f = 0; f < quartiles.size() && !context.IsCancelled(); ++f) {
    if (blocks->frame_is_fixed[f] != 0 || quartiles[f] <= 2 * median) continue;
    summary->num_moved_frames += MoveFrame(
        static_cast<int32_t>(f), options, quartiles[f],
        options.function_tolerance * summary->cost_final, context, blocks);
  }
  if (summary->num_moved_frames == 0) return;
  const int num_before = summary->num_iterations;
  BundleAdjustmentOptions rest = options;
  rest.max_num_iterations -= num_before;
  IterationObserver observer(options.callback, context);
  MinimizeLoss(rest, context, &observer, blocks, summary);
  summary->num_iterations += num_before;
}

// Solves a problem below a cap, which is lowered first if the options say so.
void MinimizeBelowCap(const BundleAdjustmentOptions& options,
                      const Context& context, const AdjustmentColumns& columns,
                      AdjustmentBlocks* blocks,
                      BundleAdjustmentSummary* summary) {
  if (options.lower_max_error) {
    LowerMaxError(options, context, columns, blocks, summary);
  }
  AdjustBelowCap(options, context, columns, blocks, summary);
  summary->max_error = std::sqrt(blocks->cap2);
}

}  // namespace

BundleAdjustmentResult AdjustBundle(
    const Model& model, const BundleAdjustmentOptions& options,
    const Context& context, AdjustmentDatum datum,
    std::optional<AdjustmentPrecision>* precision) {
  CheckOptions(options);
  const Timer timer;
  AdjustmentBlocks before =
      MakeAdjustmentBlocks(model, options.min_track_length, options.fixed);
  AdjustmentColumns columns(options, before);
  AddSurvey(model, options, &columns, &before);
  const double unit = UnitOfLength(before, context);
  DivideLengths(unit, &before);
  AdjustmentBlocks blocks = before;

  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(options);
  if (options.max_error) blocks.cap2 = *options.max_error * *options.max_error;

  BundleAdjustmentResult result;
  BundleAdjustmentSummary& summary = result.summary;
  summary.max_error = options.max_error;
  summary.sigma_px = options.sigma_px;
  Count(blocks, columns, &summary);
  const std::optional<double> cost = RobustCost(context, loss.get(), blocks);
  if (summary.num_parameters == 0) {
    summary.termination = BundleAdjustmentTermination::kNothingToAdjust;
  } else if (!cost) {
    summary.termination = BundleAdjustmentTermination::kInfeasibleStart;
  } else {
    summary.cost_initial = *cost;
    const BundleAdjustmentOptions recorded =
        RecordIterations(options, &summary);
    if (options.IsBounded()) {
      MinimizeBelowCap(recorded, context, columns, &blocks, &summary);
      summary.cost_final = *RobustCost(context, nullptr, blocks);
    } else {
      Minimize(recorded, context, &blocks, &summary);
    }
    AdjustmentBlocks restored = blocks;
    RestoreSimilarity(options, before, &restored);
    // A point next to a camera may lose its digits.
    const auto restored_cost = RobustCost(context, loss.get(), restored);
    if (restored_cost &&
        (IsZeroUpToRounding(std::sqrt(*restored_cost) -
                            std::sqrt(summary.cost_final)) ||
         *restored_cost <= (1 + kErrorRounding) * summary.cost_final)) {
      blocks = std::move(restored);
    }
  }
  DivideLengths(1 / unit, &before);
  DivideLengths(1 / unit, &blocks);
  result.model = ApplyBlocks(model, before, blocks);
  if (precision != nullptr && summary.num_parameters > 0 && cost) {
    context.Stage("computing standard deviations and redundancy numbers");
    *precision = FindPrecision(result.model, options, blocks, datum, context);
  }
  summary.seconds = timer.Seconds();
  return result;
}

void SilenceCeres() {
// The stand-in for glog that Ceres brings along is silenced when it is built.
#ifndef CERCES_INTERNAL_MINIGLOG_GLOG_LOGGING_H_
  FLAGS_minloglevel = google::GLOG_FATAL;
#endif
}

}  // namespace krot::internal
