#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"
#include "krot/adjust/barrier_system.h"
#include "krot/adjust/projected_errors.h"

namespace krot {

// Steps of a primal-dual interior point method towards the minima of the
// barrier problem of barrier_system.h as its weight mu falls: along Newton's
// direction, cut short of the cap and until the barrier cost falls. Every
// iterate is feasible. The cap moves where it has columns.
class BarrierPath {
 public:
  // Requires errors of `start` below its cap. Keeps a reference to `columns`.
  BarrierPath(const AdjustmentColumns& columns, const AdjustmentBlocks& start,
              int num_threads);

  // Begins with this weight, and with the multipliers that its minimum has.
  // Half of cap_weight is the price of the cap's square, where that moves.
  void Begin(double mu, double cap_weight = 0);
  // The weight for which such a cap has no slope.
  double CentralWeight(double cap_weight) const;

  // Takes a step, and says how much of it; 0: none that lowers the barrier
  // cost was found.
  double Step();
  // Chooses the weight for the next step after one of length `step`.
  void LowerWeight(double step);

  // The gap is the sum of multiplier times slack, relative to what is
  // minimised, the cap with its weight included.
  double gap() const;
  bool IsGapReached() const;
  // g' D^-1 g / 2, relative to what is minimised: BarrierSystem::SingleGains.
  std::optional<double> MeasureStationarity();

  const AdjustmentBlocks& blocks() const { return now_; }
  double mu() const { return mu_; }
  double count() const { return static_cast<double>(errors_.size()); }
  double cost() const { return cost_; }  // half the sum of squared errors
  double radius() const { return radius_; }
  double cap2() const { return now_.cap2; }
  double LargestError() const { return krot::LargestError(errors_); }
  int64_t NumActive() const;
  // As bundle adjustment's summary has it.
  const char* SolverName() const {
    switch (system_.kind()) {
      case FrameSystem::Kind::kSparse:
        return "sparse_schur";
      case FrameSystem::Kind::kPreconditioned:
        return "iterative_schur";
      default:
        return "dense_schur";
    }
  }

 private:
  using Errors = std::vector<ProjectedError>;

  double SlackOf(const ProjectedError& error) const {
    return Slack(cap2(), error.r.squaredNorm());
  }
  double Objective() const { return cost_ + cap_weight_ * cap2() / 2; }
  double BarrierCost(const Errors& errors, double cap2) const;

  // Newton's direction, if there is one.
  bool FindDirection();
  // The derivative of a slack along it, as that of w h by w.
  double SlackSlope(size_t i) const;
  // The longest step at most 1 that the linearised errors allow.
  double LongestStep() const;
  // Moves that far if it may.
  bool TryStep(double step, double highest_cost);
  void CentreMultipliers();
  void UpdateMultipliers(const Errors& stepped, double stepped_cap2);
  // After a step that was this share of the longest.
  void UpdateRadius(double share);

  const AdjustmentColumns& columns_;
  BarrierSystem system_;
  AdjustmentBlocks now_, trial_;
  Errors errors_;    // now
  double cost_ = 0;  // half their squared norm
  std::vector<double> multipliers_;
  double mu_ = 0;          // pixels^2
  double cap_weight_ = 0;  // 0 where the cap stays as it is
  double radius_;          // of the trust region
  // That the system is factorised with; none if it is not that of now.
  std::optional<double> factor_radius_;
};

}  // namespace krot
