#include "krot/adjust/bounded_adjustment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/timer.h"

namespace krot {
namespace {

// The first weight, as a share of the cost by observation. Starts are near the
// cap, and the larger the weight, the sooner they leave it: with outliers12 at
// 1.02 times its lowest maximum, it took 38 steps; with a weight of 1, over
// 100.
constexpr double kStartWeight = 30;
// An end is no less stationary than this.
constexpr double kStationarityTolerance = 1e-6;
// Where the cap is lowered, it begins so far above the largest error,
constexpr double kFirstCap = 1.1;
// and weighs so many times what the squared errors do: they raise the square
// of the lowest maximum by at most twice the inverse, relative.
constexpr double kCapWeight = 1e4;
// The cap of the least squares behind that is so far above the lowest maximum,
// and they start no nearer to it, relative.
constexpr double kRoom = 5e-4;
constexpr double kLeastRoom = 1e-4;

// One step of the path, told to the caller.
double Advance(const BundleAdjustmentOptions& options, const Timer& timer,
               BarrierPath* path, BundleAdjustmentSummary* summary) {
  const double step = path->Step();
  ++summary->num_iterations;
  if (options.callback) {
    BundleAdjustmentIteration iteration;
    iteration.iteration = summary->num_iterations;
    iteration.cost = path->cost();
    iteration.radius = path->radius();
    iteration.is_successful = step > 0;
    iteration.barrier = path->mu();
    iteration.cap = std::sqrt(path->cap2());
    iteration.seconds = timer.Seconds();
    options.callback(iteration);
  }
  return step;
}

}  // namespace

void AdjustBelowCap(const BundleAdjustmentOptions& options,
                    const Context& context,
                    const ceres::Solver::Options& solver_options,
                    BarrierProblem* bounded, BundleAdjustmentSummary* summary) {
  const Timer timer;
  BarrierPath path(solver_options, bounded);
  path.Begin(kStartWeight * path.cost() / path.count());
  summary->termination = BundleAdjustmentTermination::kMaxIterations;
  while (summary->num_iterations < options.max_num_iterations) {
    if (context.IsCancelled()) {
      summary->termination = BundleAdjustmentTermination::kInterrupted;
      break;
    }
    const double step = Advance(options, timer, &path, summary);
    if (path.IsGapReached()) {
      summary->stationarity = path.MeasureStationarity();
      if (summary->stationarity <= kStationarityTolerance) {
        summary->termination = BundleAdjustmentTermination::kCapConverged;
        break;
      }
      if (step == 0) {
        summary->termination = BundleAdjustmentTermination::kStalled;
        break;
      }
    }
    path.LowerWeight(step > 0 ? step : 1);
  }
  summary->stationarity = path.MeasureStationarity();
  summary->duality_gap = path.gap();
  summary->num_active = path.NumActive();
}

void LowerMaxError(const BundleAdjustmentOptions& options,
                   const Context& context,
                   const ceres::Solver::Options& solver_options,
                   BarrierProblem* bounded, BundleAdjustmentSummary* summary) {
  const Timer timer;
  const AdjustmentBlocks start = *bounded->blocks;
  bounded->blocks->cap2 = std::numeric_limits<double>::infinity();
  const double start_error =
      BarrierPath(solver_options, bounded).LargestError();
  bounded->blocks->cap2 = std::pow(kFirstCap * start_error, 2);
  BarrierPath path(solver_options, bounded);
  bounded->barrier.cap_weight = kCapWeight * path.cost() / path.cap2();
  double* cap2 = &bounded->blocks->cap2;
  bounded->problem->SetParameterBlockVariable(cap2);
  const ceres::ResidualBlockId cap_cost = bounded->problem->AddResidualBlock(
      new CapCost(&bounded->cap_slope), nullptr, cap2);
  path.Begin(path.WeightOfCap());
  while (summary->num_iterations < options.max_num_iterations &&
         !context.IsCancelled()) {
    const double step = Advance(options, timer, &path, summary);
    if (path.IsGapReached() &&
        (step == 0 || path.MeasureStationarity() <= kStationarityTolerance)) {
      break;
    }
    path.LowerWeight(step > 0 ? step : 1);
  }
  bounded->problem->RemoveResidualBlock(cap_cost);
  bounded->problem->SetParameterBlockConstant(cap2);
  bounded->barrier.cap_weight = 0;
  summary->lowest_max_error = std::min(path.LargestError(), start_error);
  const double cap = (1 + kRoom) * *summary->lowest_max_error;
  if (!(path.LargestError() < (1 - kLeastRoom) * cap)) *bounded->blocks = start;
  bounded->blocks->cap2 = cap * cap;
}

}  // namespace krot
