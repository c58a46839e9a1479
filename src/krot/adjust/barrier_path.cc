#include "krot/adjust/barrier_path.h"

#include "krot/adjust/optimality.h"

namespace krot {
namespace {

// The weight starts where the gap is the cost itself, and falls by this factor.
constexpr double kBarrierDecrease = 0.2;
// The path ends with a gap of this share of the cost.
constexpr double kGapTolerance = 1e-4;
// Relative changes of the cost at which a stage ends, before the last.
constexpr double kStageTolerance = 1e-3;
// What the end may lack in stationarity.
constexpr double kStationarityTolerance = 1e-6;
// Multipliers above this count as active: of a free error it would be 0, and
// the error itself has the weight 1.
constexpr double kActiveMultiplier = 1e-3;

}  // namespace

void FollowBarrierPath(const BundleAdjustmentOptions& options,
                       ceres::Solver::Options solver_options, BarrierLoss* loss,
                       IterationObserver* observer, ceres::Problem* problem,
                       BundleAdjustmentSummary* summary) {
  const int num_threads = solver_options.num_threads;
  SquaredErrors errors = *EvaluateErrors(num_threads, problem);
  const double count = static_cast<double>(errors.values.size());
  double mu = errors.cost / count;
  bool is_last = mu == 0;
  while (true) {
    loss->set_mu(mu);
    observer->set_barrier(mu);
    solver_options.function_tolerance =
        is_last ? options.function_tolerance : kStageTolerance;
    ceres::Solver::Summary stage;
    ceres::Solve(solver_options, problem, &stage);
    errors = *EvaluateErrors(num_threads, problem);
    if (stage.termination_type == ceres::USER_SUCCESS) {
      summary->termination = BundleAdjustmentTermination::kInterrupted;
      return;
    }
    if (is_last) break;
    mu *= kBarrierDecrease;
    is_last = count * mu <= kGapTolerance * errors.cost;
  }

  summary->stationarity = Stationarity(num_threads, problem);
  summary->duality_gap = errors.cost > 0 ? count * mu / errors.cost : 0;
  for (const double squared_error : errors.values) {
    if (loss->Multiplier(squared_error) > kActiveMultiplier) {
      ++summary->num_active;
    }
  }
  summary->termination = summary->stationarity <= kStationarityTolerance
                             ? BundleAdjustmentTermination::kCapConverged
                             : BundleAdjustmentTermination::kStalled;
}

}  // namespace krot
