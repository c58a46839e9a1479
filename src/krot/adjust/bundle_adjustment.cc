#include "krot/adjust/bundle_adjustment.h"

#include <algorithm>
#include <cctype>
#include <memory>
#include <set>

#include <ceres/solver.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_problem.h"
#include "krot/adjust/barrier_loss.h"
#include "krot/adjust/barrier_path.h"
#include "krot/adjust/iteration_observer.h"
#include "krot/adjust/optimality.h"
#include "krot/adjust/restore_similarity.h"
#include "krot/base/check.h"
#include "krot/base/parallel_for.h"
#include "krot/base/timer.h"

namespace krot {
namespace {

void CheckOptions(const BundleAdjustmentOptions& options) {
  CheckArgument(options.min_track_length >= 1, "min_track_length",
                options.min_track_length, ">= 1");
  CheckArgument(options.loss_scale > 0, "loss_scale", options.loss_scale,
                "> 0");
  CheckArgument(options.max_num_iterations >= 0, "max_num_iterations",
                options.max_num_iterations, ">= 0");
  if (!options.max_error) return;
  CheckArgument(*options.max_error > 0, "max_error", *options.max_error, "> 0");
  CheckArgument(options.loss == RobustLoss::kTrivial, "loss",
                static_cast<int>(options.loss), "trivial with a max_error");
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

// Free coordinates of a problem.
int64_t NumFreeParameters(const ceres::Problem& problem) {
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  int64_t count = 0;
  for (const double* block : blocks) {
    if (problem.IsParameterBlockConstant(block)) continue;
    count += problem.ParameterBlockTangentSize(block);
  }
  return count;
}

void Count(const AdjustmentBlocks& blocks, const ceres::Problem& problem,
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
  summary->num_parameters = NumFreeParameters(problem);
}

// With the losses; none where an error cannot be evaluated.
std::optional<double> RobustCost(int num_threads, ceres::Problem* problem) {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = num_threads;
  double cost = 0;
  if (!problem->Evaluate(options, &cost, nullptr, nullptr, nullptr)) {
    return std::nullopt;
  }
  return cost;
}

// Solves a problem without a cap.
void Minimize(const BundleAdjustmentOptions& options,
              ceres::Solver::Options solver_options, ceres::Problem* problem,
              BundleAdjustmentSummary* summary) {
  IterationObserver observer(options);
  solver_options.callbacks.push_back(&observer);
  ceres::Solver::Summary solve;
  ceres::Solve(solver_options, problem, &solve);
  summary->termination = FromCeres(solve.termination_type);
  summary->stationarity = Stationarity(solver_options.num_threads, problem);
  summary->num_iterations = observer.num_iterations();
}

}  // namespace

BundleAdjustmentResult AdjustBundle(const Model& model,
                                    const BundleAdjustmentOptions& options) {
  CheckOptions(options);
  const Timer timer;
  const AdjustmentBlocks before =
      MakeAdjustmentBlocks(model, options.min_track_length);
  AdjustmentBlocks blocks = before;

  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(options);
  Barrier barrier;
  std::vector<BarrierLoss> barrier_losses;
  TrialRecorder recorder(&blocks);
  ceres::Problem::Options problem_options = AdjustmentProblemOptions();
  LossOfObservation loss_of = [&](size_t) { return loss.get(); };
  if (options.max_error) {
    barrier.cap2 = *options.max_error * *options.max_error;
    barrier_losses.assign(blocks.observations.size(), BarrierLoss(&barrier));
    problem_options.evaluation_callback = &recorder;
    loss_of = [&](size_t i) { return &barrier_losses[i]; };
  }
  ceres::Problem problem(problem_options);
  BuildAdjustmentProblem(model, options, loss_of, &blocks, &problem);

  BundleAdjustmentResult result;
  BundleAdjustmentSummary& summary = result.summary;
  Count(blocks, problem, &summary);
  const ceres::Solver::Options solver_options =
      AdjustmentSolverOptions(options, &blocks, problem);
  summary.linear_solver = SolverName(solver_options);
  const std::optional<double> cost =
      RobustCost(solver_options.num_threads, &problem);
  if (summary.num_parameters == 0) {
    summary.termination = BundleAdjustmentTermination::kNothingToAdjust;
  } else if (!cost) {
    summary.termination = BundleAdjustmentTermination::kInfeasibleStart;
  } else {
    summary.cost_initial = *cost;
    if (options.max_error) {
      FollowBarrierPath(
          options, solver_options,
          {&problem, &blocks, &barrier, &barrier_losses, &recorder}, &summary);
      barrier.mu = 0;  // the cost without the barrier
    } else {
      Minimize(options, solver_options, &problem, &summary);
    }
    summary.cost_final = *RobustCost(solver_options.num_threads, &problem);
    RestoreSimilarity(options, before, &blocks);
  }
  result.model = ApplyBlocks(model, before, blocks);
  summary.seconds = timer.Seconds();
  return result;
}

}  // namespace krot
