#include "krot/adjust/barrier_path.h"

#include <algorithm>
#include <cmath>

#include "krot/adjust/optimality.h"
#include "krot/adjust/projected_errors.h"
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
// The weight falls by this factor after a step at least this long: after
// shorter ones its minimum is still far, and slacks that fall behind the weight
// make all further steps short.
constexpr double kCentering = 0.2;
constexpr double kFallingStep = 0.5;
// A step that leads too far is shortened by this factor.
constexpr double kShortening = 0.7;
// The trust region shrinks after a step of less than this share of what the
// linearised errors promised.
constexpr double kPoorShare = 0.3;
// Trust regions: no larger, and smaller no more.
constexpr double kLargestRadius = 1e6;
constexpr double kMinRadius = 1e-6;
// Where the derivative of the errors along a step is taken.
constexpr double kProbe = 1e-4;
constexpr double kShortestProbe = 1e-12;
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
  // Requires errors below the cap.
  BarrierPath(const ceres::Solver::Options& solver_options,
              const BarrierProblem& bounded)
      : solver_options_(solver_options), bounded_(bounded) {
    solver_options_.max_num_iterations = 1;
    solver_options_.update_state_every_iteration = false;
    errors_ = *ProjectBlocks();
    cost_ = HalfSquaredNorm(errors_);
    set_mu(cost_ / count());
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
    return Stationarity(solver_options_.num_threads, cost_, bounded_.problem);
  }
  int64_t NumActive() const;

 private:
  using Errors = std::vector<ProjectedError>;

  void set_mu(double mu) { bounded_.barrier->mu = mu; }
  std::vector<double>& multipliers() const { return *bounded_.multipliers; }
  double count() const { return static_cast<double>(multipliers().size()); }
  double cap2() const { return bounded_.barrier->cap2; }
  double Slack(const ProjectedError& error) const {
    return bounded_.barrier->Slack(error.r.squaredNorm());
  }

  double BarrierCost(const Errors& errors) const;
  // None where an error reaches the cap.
  std::optional<Errors> ProjectBlocks() const {
    return ProjectErrors(*bounded_.blocks, std::sqrt(cap2()),
                         solver_options_.num_threads);
  }
  std::optional<Errors> ProjectAt(const AdjustmentBlocks& from,
                                  const AdjustmentBlocks& to,
                                  double step) const {
    Interpolate(from, to, step, bounded_.blocks);
    return ProjectBlocks();
  }

  // Where Newton's step leads.
  std::optional<AdjustmentBlocks> FindTrial();
  // The derivatives of errors and depths on the way to the trial.
  std::optional<Errors> FindSlopes(const AdjustmentBlocks& from,
                                   const AdjustmentBlocks& trial) const;
  // The longest step at most 1 that the linearised errors allow.
  double LongestStep(const Errors& slopes) const;
  // mu / h, what they are at the minimum of the barrier.
  void CenterMultipliers() {
    for (size_t i = 0; i < errors_.size(); ++i) {
      multipliers()[i] = mu() / Slack(errors_[i]);
    }
  }
  void UpdateMultipliers(const Errors& slopes, const Errors& stepped);
  // After a step that was this share of the longest.
  void UpdateRadius(double share);

  ceres::Solver::Options solver_options_;
  BarrierProblem bounded_;
  Errors errors_;    // at the blocks
  double cost_ = 0;  // half their squared norm
  double radius_ = kLargestRadius;
};

double BarrierPath::BarrierCost(const Errors& errors) const {
  double sum = 0;
  for (const ProjectedError& error : errors) {
    const double squared = error.r.squaredNorm();
    sum += squared / 2 - mu() * std::log1p(-squared / cap2());
  }
  return sum;
}

std::optional<AdjustmentBlocks> BarrierPath::FindTrial() {
  solver_options_.initial_trust_region_radius = radius_;
  bounded_.recorder->Start();
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options_, bounded_.problem, &summary);
  return bounded_.recorder->Stop();
}

std::optional<BarrierPath::Errors> BarrierPath::FindSlopes(
    const AdjustmentBlocks& from, const AdjustmentBlocks& trial) const {
  for (double probe = kProbe; probe > kShortestProbe; probe /= 100) {
    std::optional<Errors> slopes = ProjectAt(from, trial, probe);
    if (!slopes) continue;
    for (size_t i = 0; i < slopes->size(); ++i) {
      ProjectedError& slope = (*slopes)[i];
      slope.r = (slope.r - errors_[i].r) / probe;
      slope.w = (slope.w - errors_[i].w) / probe;
    }
    return slopes;
  }
  return std::nullopt;
}

double BarrierPath::LongestStep(const Errors& slopes) const {
  double longest = 1;
  for (size_t i = 0; i < errors_.size(); ++i) {
    // w r and w are nearly affine: |r + step v| = cap (1 + step u)
    const double u = slopes[i].w / errors_[i].w;
    const Eigen::Vector2d v = slopes[i].r + u * errors_[i].r;
    const double a = cap2() * u * u - v.squaredNorm();
    const double b = cap2() * u - errors_[i].r.dot(v);
    const double c = 2 * Slack(errors_[i]);
    const double discriminant = b * b - a * c;
    if (discriminant < 0) continue;
    const double denominator = std::sqrt(discriminant) - b;
    if (denominator <= 0) continue;
    longest = std::min(longest, (1 - kBoundaryShare) * c / denominator);
  }
  return longest;
}

void BarrierPath::UpdateMultipliers(const Errors& slopes,
                                    const Errors& stepped) {
  for (size_t i = 0; i < errors_.size(); ++i) {
    const double h = Slack(errors_[i]);
    const double h_change = h * slopes[i].w / errors_[i].w -
                            errors_[i].r.dot(slopes[i].r);  // w h, by w
    const double lambda = multipliers()[i];
    // lambda h + h dlambda + lambda dh = mu
    const double newton = (mu() - lambda * h_change) / h;
    const double central = mu() / Slack(stepped[i]);
    multipliers()[i] =
        std::clamp(std::max(newton, kBoundaryShare * lambda),
                   central / kMultiplierRange, central * kMultiplierRange);
  }
}

double BarrierPath::Step() {
  const AdjustmentBlocks from = *bounded_.blocks;
  const double highest = BarrierCost(errors_) + kCostRounding * cost_;
  while (radius_ >= kMinRadius) {
    const std::optional<AdjustmentBlocks> trial = FindTrial();
    const std::optional<Errors> slopes =
        trial ? FindSlopes(from, *trial) : std::nullopt;
    const double longest = slopes ? LongestStep(*slopes) : 0;
    for (double step = longest; step > kShortestStep; step *= kShortening) {
      std::optional<Errors> stepped = ProjectAt(from, *trial, step);
      if (!stepped || !(BarrierCost(*stepped) <= highest)) continue;
      UpdateMultipliers(*slopes, *stepped);
      errors_ = std::move(*stepped);
      cost_ = HalfSquaredNorm(errors_);
      UpdateRadius(step / longest);
      return step;
    }
    *bounded_.blocks = from;
    radius_ /= 100;
  }
  radius_ = kLargestRadius;
  CenterMultipliers();
  return 0;
}

void BarrierPath::UpdateRadius(double share) {
  if (share < kPoorShare) {
    radius_ = std::max(radius_ / 10, std::min(radius_, 1.0));
  } else if (share > 0.5) {
    radius_ = std::min(10 * radius_, kLargestRadius);
  }
}

void BarrierPath::LowerWeight(double step) {
  if (step < kFallingStep) return;
  const double last = 0.5 * kGapTolerance * cost_ / count();
  set_mu(std::max(last, kCentering * mu()));
}

int64_t BarrierPath::NumActive() const {
  int64_t count = 0;
  for (const ProjectedError& error : errors_) {
    if (mu() / Slack(error) > kActiveMultiplier) ++count;
  }
  return count;
}

}  // namespace

void FollowBarrierPath(const BundleAdjustmentOptions& options,
                       const Context& context,
                       const ceres::Solver::Options& solver_options,
                       const BarrierProblem& bounded,
                       BundleAdjustmentSummary* summary) {
  const Timer timer;
  BarrierPath path(solver_options, bounded);
  summary->termination = BundleAdjustmentTermination::kMaxIterations;
  for (int& n = summary->num_iterations; n < options.max_num_iterations;) {
    if (context.IsCancelled()) {
      summary->termination = BundleAdjustmentTermination::kInterrupted;
      break;
    }
    const double step = path.Step();
    ++n;
    if (options.callback) {
      options.callback({n, path.cost(), path.radius(), step > 0, path.mu(),
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
