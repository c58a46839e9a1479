#include "krot/adjust/bounded_adjustment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/adjust/barrier_path.h"
#include "krot/adjust/projected_errors.h"
#include "krot/base/timer.h"

namespace krot {
namespace {

// The first weight, as a share of the cost by observation: a small one holds a
// start near the cap there, or leads to a poorer local minimum. At 1.02 times
// its lowest maximum, door took 19 steps to 11164 pixels^2 with 15, 23 to 11222
// with 10, and 21 to 11323 with 3; elsewhere 3 to 30 differ by less.
constexpr double kStartWeight = 15;
// An end is no less stationary than this.
constexpr double kStationarityTolerance = 1e-6;
// Where the cap is lowered, it begins so far above the largest error,
constexpr double kFirstCap = 1.1;
// and weighs so many times what the squared errors do: they raise the square
// of the lowest maximum by at most twice the inverse, relative.
constexpr double kCapWeight = 1e4;
// The cap of the least squares behind that is so far above the lowest maximum,
// and they start no nearer to it, relative.
constexpr double kCapRoom = 5e-4;
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
                    const Context& context, const AdjustmentColumns& columns,
                    AdjustmentBlocks* blocks,
                    BundleAdjustmentSummary* summary) {
  const Timer timer;
  BarrierPath path(columns, *blocks, context.num_threads);
  summary->linear_solver = path.SolverName();
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
  *blocks = path.blocks();
}

void LowerMaxError(const BundleAdjustmentOptions& options,
                   const Context& context, const AdjustmentColumns& columns,
                   AdjustmentBlocks* blocks, BundleAdjustmentSummary* summary) {
  const Timer timer;
  AdjustmentColumns with_cap = columns;
  with_cap.AddCap();
  const double start_error = LargestError(*ProjectErrors(
      *blocks, std::numeric_limits<double>::infinity(), context.num_threads));
  blocks->cap2 = std::pow(kFirstCap * start_error, 2);
  BarrierPath path(with_cap, *blocks, context.num_threads);
  const double cap_weight = kCapWeight * path.cost() / path.cap2();
  path.Begin(path.CentralWeight(cap_weight), cap_weight);
  while (summary->num_iterations < options.max_num_iterations &&
         !context.IsCancelled()) {
    const double step = Advance(options, timer, &path, summary);
    if (path.IsGapReached() &&
        (step == 0 || path.MeasureStationarity() <= kStationarityTolerance)) {
      break;
    }
    path.LowerWeight(step > 0 ? step : 1);
  }
  summary->lowest_max_error = std::min(path.LargestError(), start_error);
  const double cap = (1 + kCapRoom) * *summary->lowest_max_error;
  if (path.LargestError() < (1 - kLeastRoom) * cap) *blocks = path.blocks();
  blocks->cap2 = cap * cap;
}

}  // namespace krot
