#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <ceres/evaluation_callback.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/barrier_cost.h"
#include "krot/adjust/projected_errors.h"

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

// What a bounded adjustment works on: a problem of BarrierCosts that refer to
// `barrier` and `multipliers`, one per observation in their order, and whose
// evaluation callback is `recorder`; where the cap moves, with a CapCost.
struct BarrierProblem {
  explicit BarrierProblem(AdjustmentBlocks* all_blocks)
      : blocks(all_blocks),
        multipliers(all_blocks->observations.size()),
        recorder(all_blocks) {}

  AdjustmentBlocks* blocks;
  ceres::Problem* problem = nullptr;
  Barrier barrier;
  CapSlope cap_slope;
  std::vector<double> multipliers;
  TrialRecorder recorder;
};

// Steps of a primal-dual interior point method towards the minima of the
// barrier problem as its weight falls: Ceres finds the direction of every step,
// which is then cut short of the cap and until the barrier cost falls. Every
// iterate is feasible. The cap moves where it has a weight.
class BarrierPath {
 public:
  // Requires errors below the cap.
  BarrierPath(const ceres::Solver::Options& solver_options,
              BarrierProblem* bounded);

  // Begins with this weight, and with the multipliers that its minimum has.
  void Begin(double mu);
  // That for which the cap has no slope.
  double WeightOfCap() const;

  // Takes a step, and says how much of it; 0: none that lowers the barrier
  // cost was found.
  double Step();
  // Chooses the weight for the next step after one of length `step`.
  void LowerWeight(double step);

  // The gap is the sum of multiplier times slack, relative to what is
  // minimised, the cap with its weight included.
  double gap() const;
  bool IsGapReached() const;

  double mu() const { return bounded_.barrier.mu; }
  double count() const { return static_cast<double>(errors_.size()); }
  double cost() const { return cost_; }  // half the sum of squared errors
  double radius() const { return radius_; }
  double LargestError() const;
  double cap2() const { return bounded_.blocks->cap2; }
  std::optional<double> MeasureStationarity();
  int64_t NumActive() const;

 private:
  using Errors = std::vector<ProjectedError>;

  void set_mu(double mu) { bounded_.barrier.mu = mu; }
  std::vector<double>& multipliers() const { return bounded_.multipliers; }
  double cap_weight() const { return bounded_.barrier.cap_weight; }
  double SlackOf(const ProjectedError& error) const {
    return Slack(cap2(), error.r.squaredNorm());
  }

  double Objective() const { return cost_ + cap_weight() * cap2() / 2; }
  double BarrierCost(const Errors& errors) const;
  // None where an error reaches the cap.
  std::optional<Errors> ProjectBlocks() const;
  std::optional<Errors> ProjectAt(const AdjustmentBlocks& from,
                                  const AdjustmentBlocks& to,
                                  double step) const;

  // Where Newton's step leads.
  std::optional<AdjustmentBlocks> FindTrial();
  void FindCapSlope();
  // The derivatives of errors and depths on the way to the trial.
  std::optional<Errors> FindSlopes(const AdjustmentBlocks& from,
                                   const AdjustmentBlocks& trial) const;
  // The longest step at most 1 that the linearised errors allow; `cap2_slope`
  // is the derivative of cap2.
  double LongestStep(const Errors& slopes, double cap2_slope) const;
  void CentreMultipliers();
  void UpdateMultipliers(const Errors& slopes, double cap2_slope,
                         const Errors& stepped, double cap2_before);
  // After a step that was this share of the longest.
  void UpdateRadius(double share);

  ceres::Solver::Options solver_options_;
  BarrierProblem& bounded_;
  Errors errors_;    // at the blocks
  double cost_ = 0;  // half their squared norm
  double radius_;
};

}  // namespace krot
