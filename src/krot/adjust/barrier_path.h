#pragma once

#include <optional>
#include <utility>
#include <vector>

#include <ceres/evaluation_callback.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/barrier_cost.h"
#include "krot/adjust/bundle_adjustment.h"

namespace krot {

// Keeps the last point at which Ceres asked for errors without derivatives:
// where its step leads, whether it then takes the step or not.
class TrialRecorder final : public ceres::EvaluationCallback {
 public:
  explicit TrialRecorder(const AdjustmentBlocks* blocks) : blocks_(*blocks) {}

  void PrepareForEvaluation(bool evaluate_jacobians,
                            bool new_evaluation_point) override {
    if (!is_recording_ || evaluate_jacobians || !new_evaluation_point) return;
    trial_ = blocks_;
  }

  void Start() {
    is_recording_ = true;
    trial_.reset();
  }
  // None if there was no step.
  std::optional<AdjustmentBlocks> Stop() {
    is_recording_ = false;
    return std::move(trial_);
  }

 private:
  const AdjustmentBlocks& blocks_;
  bool is_recording_ = false;
  std::optional<AdjustmentBlocks> trial_;
};

// What a bounded adjustment works on. The problem's costs are BarrierCosts that
// refer to `barrier` and to `multipliers`, one per observation in their order;
// `recorder` is its evaluation callback.
struct BarrierProblem {
  ceres::Problem* problem;
  AdjustmentBlocks* blocks;
  Barrier* barrier;
  std::vector<double>* multipliers;
  TrialRecorder* recorder;
};

// Follows the minima of the barrier problem as its weight falls, by a
// primal-dual interior point method: Ceres finds the direction of every step,
// which is then cut short of the cap and until the barrier cost falls. Every
// iterate is feasible, as the start must be. Fills in what the summary says of
// the end: termination, num_iterations, stationarity, duality_gap, num_active.
void FollowBarrierPath(const BundleAdjustmentOptions& options,
                       const Context& context,
                       const ceres::Solver::Options& solver_options,
                       const BarrierProblem& bounded,
                       BundleAdjustmentSummary* summary);

}  // namespace krot
