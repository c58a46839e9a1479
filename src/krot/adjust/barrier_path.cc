#include "krot/adjust/barrier_path.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace krot {
namespace {

// The path ends with a gap of this share of what is minimised.
constexpr double kGapTolerance = 1e-4;
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
constexpr double kShortestStep = 1e-6;
// The trust region shrinks after a step of less than this share of what the
// linearised errors promised.
constexpr double kPoorShare = 0.3;
// Trust regions: no larger, and smaller no more.
constexpr double kLargestRadius = 1e6;
constexpr double kMinRadius = 1e-6;
// What a step may add to the barrier cost by rounding, relative.
constexpr double kCostRounding = 1e-12;
// Multipliers above this count as active; a squared error has the weight 1.
constexpr double kActiveMultiplier = 1e-3;

}  // namespace

BarrierPath::BarrierPath(const AdjustmentColumns& columns,
                         const AdjustmentBlocks& start, int num_threads)
    : columns_(columns),
      system_(columns, start, num_threads),
      now_(start),
      trial_(start),
      errors_(*ProjectErrors(start, std::sqrt(start.cap2), num_threads)),
      cost_(HalfSquaredNorm(errors_)),
      multipliers_(errors_.size()),
      radius_(kLargestRadius) {}

void BarrierPath::Begin(double mu, double cap_weight) {
  mu_ = mu;
  cap_weight_ = cap_weight;
  CentreMultipliers();
}

double BarrierPath::CentralWeight(double cap_weight) const {
  double sum = 0;
  for (const ProjectedError& error : errors_) sum += 1 / SlackOf(error);
  return cap_weight / sum;
}

double BarrierPath::gap() const {
  const double objective = Objective();
  return objective > 0 ? count() * mu_ / objective : 0;
}

bool BarrierPath::IsGapReached() const {
  return count() * mu_ <= kGapTolerance * Objective();
}

std::optional<double> BarrierPath::MeasureStationarity() {
  if (!FindDirection()) return std::nullopt;
  const double objective = Objective();
  return objective > 0 ? system_.SingleGains() / objective : 0;
}

void BarrierPath::CentreMultipliers() {
  for (size_t i = 0; i < errors_.size(); ++i) {
    multipliers_[i] = mu_ / SlackOf(errors_[i]);
  }
  factor_radius_.reset();
}

double BarrierPath::BarrierCost(const Errors& errors, double cap2) const {
  double sum = 0;
  for (const ProjectedError& error : errors) {
    const double squared = error.r.squaredNorm();
    sum += squared / 2 - mu_ * std::log1p(-squared / cap2);
  }
  if (cap_weight_ > 0) {
    sum += cap_weight_ * cap2 / 2 - mu_ * count() * std::log(cap2);
  }
  return sum;
}

bool BarrierPath::FindDirection() {
  if (!factor_radius_) system_.Linearize(now_, errors_, multipliers_);
  if (factor_radius_ != radius_) {
    factor_radius_.reset();
    if (!system_.Factorize(radius_)) return false;
    factor_radius_ = radius_;
  }
  system_.Solve(mu_, cap_weight_);
  return true;
}

double BarrierPath::SlackSlope(size_t i) const {
  const Eigen::Vector3d& slope = system_.direction().slopes[i];
  return SlackOf(errors_[i]) * slope[2] / errors_[i].w -
         errors_[i].r.dot(slope.head<2>()) + system_.cap2_slope() / 2;
}

double BarrierPath::LongestStep() const {
  double longest = 1;
  for (size_t i = 0; i < errors_.size(); ++i) {
    // w r, w and cap w are nearly affine: |r + step v| = cap (1 + step u)
    const Eigen::Vector3d& slope = system_.direction().slopes[i];
    const double w_slope = slope[2] / errors_[i].w;
    const Eigen::Vector2d v = slope.head<2>() + w_slope * errors_[i].r;
    const double u = w_slope + system_.cap2_slope() / (2 * cap2());
    const double a = cap2() * u * u - v.squaredNorm();
    const double b = cap2() * u - errors_[i].r.dot(v);
    const double c = 2 * SlackOf(errors_[i]);
    const double discriminant = b * b - a * c;
    if (discriminant < 0) continue;
    const double denominator = std::sqrt(discriminant) - b;
    if (denominator <= 0) continue;
    longest = std::min(longest, (1 - kBoundaryShare) * c / denominator);
  }
  return longest;
}

bool BarrierPath::TryStep(double step, double highest_cost) {
  MoveAlong(columns_, now_, system_.direction().unknowns, step, &trial_);
  std::optional<Errors> stepped = ProjectErrors(trial_, std::sqrt(trial_.cap2),
                                                system_.loop().num_threads());
  if (!stepped || !(BarrierCost(*stepped, trial_.cap2) <= highest_cost)) {
    return false;
  }
  UpdateMultipliers(*stepped, trial_.cap2);
  std::swap(now_, trial_);
  errors_ = std::move(*stepped);
  cost_ = HalfSquaredNorm(errors_);
  factor_radius_.reset();
  return true;
}

void BarrierPath::UpdateMultipliers(const Errors& stepped,
                                    double stepped_cap2) {
  for (size_t i = 0; i < errors_.size(); ++i) {
    const double h = SlackOf(errors_[i]);
    const double lambda = multipliers_[i];
    // lambda h + h dlambda + lambda dh = mu
    const double newton = (mu_ - lambda * SlackSlope(i)) / h;
    const double central =
        mu_ / Slack(stepped_cap2, stepped[i].r.squaredNorm());
    multipliers_[i] =
        std::clamp(std::max(newton, kBoundaryShare * lambda),
                   central / kMultiplierRange, central * kMultiplierRange);
  }
}

double BarrierPath::Step() {
  const double highest =
      BarrierCost(errors_, cap2()) + kCostRounding * Objective();
  for (; radius_ >= kMinRadius; radius_ /= 100) {
    const double longest = FindDirection() ? LongestStep() : 0;
    for (double step = longest; step > kShortestStep; step *= kShortening) {
      if (!TryStep(step, highest)) continue;
      UpdateRadius(step / longest);
      return step;
    }
  }
  radius_ = kLargestRadius;
  CentreMultipliers();
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
  const double last = 0.5 * kGapTolerance * Objective() / count();
  mu_ = std::max(last, kCentering * mu_);
}

int64_t BarrierPath::NumActive() const {
  int64_t count = 0;
  for (const ProjectedError& error : errors_) {
    if (mu_ / SlackOf(error) > kActiveMultiplier) ++count;
  }
  return count;
}

}  // namespace krot
