#include "krot/adjust/barrier_path.h"

#include <algorithm>
#include <cmath>

#include "krot/adjust/optimality.h"
#include "krot/base/timer.h"

namespace krot {
namespace {

// The path ends with a gap of this share of the cost,
constexpr double kGapTolerance = 1e-4;
// and no less stationary than this.
constexpr double kStationarityTolerance = 1e-6;
// What a step leaves of the way to the cap, and of a multiplier, at least.
constexpr double kBoundaryShare = 0.01;
// Multipliers stay within this factor of mu / h.
constexpr double kMultiplierRange = 100;
// The weight falls by no more than this factor per step.
constexpr double kMinCentering = 0.1;
// Trust regions: no larger, and smaller no more.
constexpr double kMaxRadius = 1e6;
constexpr double kMinRadius = 1e-6;
// Where the derivative of the errors along a step is taken.
constexpr double kProbe = 1e-4;
constexpr double kShortestStep = 1e-6;
// What a step may add to the barrier cost by rounding, relative.
constexpr double kCostRounding = 1e-12;
// Multipliers above this count as active; a squared error has the weight 1.
constexpr double kActiveMultiplier = 1e-3;

// a + step (b - a), its quaternions of unit norm.
void Interpolate(const AdjustmentBlocks& a, const AdjustmentBlocks& b,
                 double step, AdjustmentBlocks* blocks) {
  const auto mix = [step](const auto& from, const auto& to, auto* result) {
    for (size_t i = 0; i < from.size(); ++i) {
      (*result)[i] = from[i] + step * (to[i] - from[i]);
    }
  };
  const auto mix_poses = [&](const std::vector<PoseBlock>& from,
                             const std::vector<PoseBlock>& to,
                             std::vector<PoseBlock>* result) {
    for (size_t i = 0; i < from.size(); ++i) {
      if (from[i] == to[i]) continue;
      mix(from[i], to[i], &(*result)[i]);
      Eigen::Map<Eigen::Vector4d>((*result)[i].data()).normalize();
    }
  };
  mix_poses(a.frames, b.frames, &blocks->frames);
  mix_poses(a.sensors, b.sensors, &blocks->sensors);
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    mix(a.cameras[c], b.cameras[c], &blocks->cameras[c]);
  }
  mix(a.points, b.points, &blocks->points);
}

class BarrierPath {
 public:
  BarrierPath(const BundleAdjustmentOptions& options,
              const ceres::Solver::Options& solver_options,
              const BarrierProblem& bounded)
      : options_(options), solver_options_(solver_options), bounded_(bounded) {
    solver_options_.max_num_iterations = 1;
    solver_options_.update_state_every_iteration = false;
    Residuals residuals = *EvaluateResiduals();
    cost_ = HalfSquaredNorm(residuals);
    set_mu(cost_ / count());
    residuals_ = std::move(residuals);
    CenterMultipliers();
  }

  // Takes a step, and says how much of it; 0: none that lowers the barrier
  // cost was found.
  double Step();

  // Chooses the weight for the next step after one of length `step`.
  void LowerWeight(double step);

  bool IsGapReached() const { return count() * mu() <= kGapTolerance * cost_; }

  double mu() const { return bounded_.barrier->mu; }
  double cost() const { return cost_; }
  double radius() const { return radius_; }
  double gap() const { return cost_ > 0 ? count() * mu() / cost_ : 0; }
  std::optional<double> MeasureStationarity() const {
    return Stationarity(solver_options_.num_threads, bounded_.problem);
  }
  int64_t NumActive() const;

 private:
  using Residuals = std::vector<double>;  // two per observation

  void set_mu(double mu) { bounded_.barrier->mu = mu; }
  std::vector<BarrierLoss>& losses() const { return *bounded_.losses; }
  double count() const { return static_cast<double>(losses().size()); }

  double Slack(const Residuals& residuals, size_t i) const {
    return losses()[i].Slack(residuals[2 * i] * residuals[2 * i] +
                             residuals[2 * i + 1] * residuals[2 * i + 1]);
  }
  // Half the sum of the losses.
  double BarrierCost(const Residuals& residuals) const;
  // None where an error reaches the cap.
  std::optional<Residuals> EvaluateResiduals() const {
    return krot::EvaluateResiduals(solver_options_.num_threads,
                                   bounded_.problem);
  }
  std::optional<Residuals> EvaluateAt(const AdjustmentBlocks& from,
                                      const AdjustmentBlocks& to,
                                      double step) const {
    Interpolate(from, to, step, bounded_.blocks);
    return EvaluateResiduals();
  }

  // Where Newton's step leads.
  std::optional<AdjustmentBlocks> FindTrial();
  // The longest step at most 1 that the linearised errors allow.
  double LongestStep(const Residuals& slopes) const;
  // mu / h, what they are at the minimum of the barrier.
  void CenterMultipliers() {
    for (size_t i = 0; i < losses().size(); ++i) {
      losses()[i].set_multiplier(mu() / Slack(residuals_, i));
    }
  }
  void UpdateMultipliers(const Residuals& slopes, const Residuals& stepped);

  const BundleAdjustmentOptions& options_;
  ceres::Solver::Options solver_options_;
  BarrierProblem bounded_;
  Residuals residuals_;  // at the blocks
  double cost_ = 0;      // half their squared norm
  double radius_ = kMaxRadius;
};

double BarrierPath::BarrierCost(const Residuals& residuals) const {
  double sum = 0;
  for (size_t i = 0; i < losses().size(); ++i) {
    double rho[3];
    const double x = residuals[2 * i], y = residuals[2 * i + 1];
    losses()[i].Evaluate(x * x + y * y, rho);
    sum += rho[0];
  }
  return sum / 2;
}

std::optional<AdjustmentBlocks> BarrierPath::FindTrial() {
  solver_options_.initial_trust_region_radius = radius_;
  bounded_.recorder->Start();
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options_, bounded_.problem, &summary);
  return bounded_.recorder->Stop();
}

double BarrierPath::LongestStep(const Residuals& slopes) const {
  // |r + step slope|^2 = cap2
  double longest = 1;
  for (size_t i = 0; i < losses().size(); ++i) {
    const Eigen::Map<const Eigen::Vector2d> r(&residuals_[2 * i]);
    const Eigen::Map<const Eigen::Vector2d> slope(&slopes[2 * i]);
    const double a = slope.squaredNorm();
    if (a == 0) continue;
    const double half_b = r.dot(slope);
    const double slack = 2 * Slack(residuals_, i);
    const double root = std::sqrt(half_b * half_b + a * slack);
    const double to_cap =
        half_b > 0 ? slack / (half_b + root) : (root - half_b) / a;
    longest = std::min(longest, (1 - kBoundaryShare) * to_cap);
  }
  return longest;
}

void BarrierPath::UpdateMultipliers(const Residuals& slopes,
                                    const Residuals& stepped) {
  for (size_t i = 0; i < losses().size(); ++i) {
    const double h = Slack(residuals_, i);
    const double h_change = -(residuals_[2 * i] * slopes[2 * i] +
                              residuals_[2 * i + 1] * slopes[2 * i + 1]);
    const double lambda = losses()[i].multiplier();
    // lambda h + h dlambda + lambda dh = mu
    const double newton = (mu() - lambda * h_change) / h;
    const double central = mu() / Slack(stepped, i);
    losses()[i].set_multiplier(
        std::clamp(std::max(newton, kBoundaryShare * lambda),
                   central / kMultiplierRange, central * kMultiplierRange));
  }
}

double BarrierPath::Step() {
  const AdjustmentBlocks from = *bounded_.blocks;
  while (radius_ >= kMinRadius) {
    const std::optional<AdjustmentBlocks> trial = FindTrial();
    double probe = kProbe;
    std::optional<Residuals> slopes;
    while (trial && !slopes && probe > 1e-12) {
      slopes = EvaluateAt(from, *trial, probe);
      if (!slopes) probe /= 100;
    }
    if (slopes) {
      for (size_t i = 0; i < slopes->size(); ++i) {
        (*slopes)[i] = ((*slopes)[i] - residuals_[i]) / probe;
      }
      const double highest = (1 + kCostRounding) * BarrierCost(residuals_);
      for (double step = LongestStep(*slopes); step > kShortestStep;
           step /= 2) {
        std::optional<Residuals> stepped = EvaluateAt(from, *trial, step);
        if (!stepped || !(BarrierCost(*stepped) <= highest)) continue;
        UpdateMultipliers(*slopes, *stepped);
        residuals_ = std::move(*stepped);
        cost_ = HalfSquaredNorm(residuals_);
        radius_ = std::min(10 * radius_, kMaxRadius);
        return step;
      }
    }
    Interpolate(from, from, 0, bounded_.blocks);
    radius_ /= 100;
  }
  radius_ = kMaxRadius;
  CenterMultipliers();
  return 0;
}

void BarrierPath::LowerWeight(double step) {
  double complementarity = 0;
  for (size_t i = 0; i < losses().size(); ++i) {
    complementarity += losses()[i].multiplier() * Slack(residuals_, i);
  }
  complementarity /= count();
  const double centering = std::max(kMinCentering, (1 - step) * (1 - step));
  const double last = 0.5 * kGapTolerance * cost_ / count();
  set_mu(std::max(last, std::min(mu(), centering * complementarity)));
}

int64_t BarrierPath::NumActive() const {
  int64_t count = 0;
  for (size_t i = 0; i < losses().size(); ++i) {
    if (mu() / Slack(residuals_, i) > kActiveMultiplier) ++count;
  }
  return count;
}

}  // namespace

void FollowBarrierPath(const BundleAdjustmentOptions& options,
                       const ceres::Solver::Options& solver_options,
                       const BarrierProblem& bounded,
                       BundleAdjustmentSummary* summary) {
  const Timer timer;
  BarrierPath path(options, solver_options, bounded);
  summary->termination = BundleAdjustmentTermination::kMaxIterations;
  for (int& n = summary->num_iterations; n < options.max_num_iterations; ++n) {
    if (IsCancelled(options.cancel)) {
      summary->termination = BundleAdjustmentTermination::kInterrupted;
      break;
    }
    const double step = path.Step();
    if (options.callback) {
      options.callback({n + 1, path.cost(), path.radius(), step > 0, path.mu(),
                        timer.Seconds()});
    }
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

}  // namespace krot
