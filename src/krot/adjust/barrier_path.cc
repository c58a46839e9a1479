#include "krot/adjust/barrier_path.h"

#include <algorithm>
#include <cmath>

#include "krot/adjust/optimality.h"

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

}  // namespace

BarrierPath::BarrierPath(const ceres::Solver::Options& solver_options,
                         BarrierProblem* bounded)
    : solver_options_(solver_options),
      bounded_(*bounded),
      radius_(kLargestRadius) {
  solver_options_.max_num_iterations = 1;
  solver_options_.update_state_every_iteration = false;
  errors_ = *ProjectBlocks();
  cost_ = HalfSquaredNorm(errors_);
}

void BarrierPath::Begin(double mu) {
  set_mu(mu);
  CentreMultipliers();
}

double BarrierPath::WeightOfCap() const {
  double sum = 0;
  for (const ProjectedError& error : errors_) sum += 1 / SlackOf(error);
  return cap_weight() / sum;
}

double BarrierPath::gap() const {
  const double objective = Objective();
  return objective > 0 ? count() * mu() / objective : 0;
}

bool BarrierPath::IsGapReached() const {
  return count() * mu() <= kGapTolerance * Objective();
}

double BarrierPath::LargestError() const {
  double largest2 = 0;
  for (const ProjectedError& error : errors_) {
    largest2 = std::max(largest2, error.r.squaredNorm());
  }
  return std::sqrt(largest2);
}

std::optional<double> BarrierPath::MeasureStationarity() {
  if (cap_weight() > 0) FindCapSlope();
  return Stationarity(solver_options_.num_threads, Objective(),
                      bounded_.problem);
}

std::optional<BarrierPath::Errors> BarrierPath::ProjectBlocks() const {
  return ProjectErrors(*bounded_.blocks, std::sqrt(cap2()),
                       solver_options_.num_threads);
}

std::optional<BarrierPath::Errors> BarrierPath::ProjectAt(
    const AdjustmentBlocks& from, const AdjustmentBlocks& to,
    double step) const {
  Interpolate(from, to, step, bounded_.blocks);
  return ProjectBlocks();
}

void BarrierPath::CentreMultipliers() {
  for (size_t i = 0; i < errors_.size(); ++i) {
    multipliers()[i] = mu() / SlackOf(errors_[i]);
  }
}

double BarrierPath::BarrierCost(const Errors& errors) const {
  double sum = 0;
  for (const ProjectedError& error : errors) {
    const double squared = error.r.squaredNorm();
    sum += squared / 2 - mu() * std::log1p(-squared / cap2());
  }
  if (cap_weight() > 0) {
    sum += cap_weight() * cap2() / 2 - mu() * count() * std::log(cap2());
  }
  return sum;
}

void BarrierPath::FindCapSlope() {
  CapSlope& cap = bounded_.cap_slope;
  cap = {cap_weight() / 2, 0};
  for (size_t i = 0; i < errors_.size(); ++i) {
    const double h = SlackOf(errors_[i]);
    cap.slope -= mu() / (2 * h);
    cap.curvature += multipliers()[i] / (4 * h);
  }
}

std::optional<AdjustmentBlocks> BarrierPath::FindTrial() {
  if (cap_weight() > 0) FindCapSlope();
  solver_options_.initial_trust_region_radius = radius_;
  bounded_.recorder.Start();
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options_, bounded_.problem, &summary);
  return bounded_.recorder.Stop();
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

double BarrierPath::LongestStep(const Errors& slopes, double cap2_slope) const {
  double longest = 1;
  for (size_t i = 0; i < errors_.size(); ++i) {
    // w r, w and cap w are nearly affine: |r + step v| = cap (1 + step u)
    const double w_slope = slopes[i].w / errors_[i].w;
    const Eigen::Vector2d v = slopes[i].r + w_slope * errors_[i].r;
    const double u = w_slope + cap2_slope / (2 * cap2());
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

void BarrierPath::UpdateMultipliers(const Errors& slopes, double cap2_slope,
                                    const Errors& stepped, double cap2_before) {
  for (size_t i = 0; i < errors_.size(); ++i) {
    const double h = Slack(cap2_before, errors_[i].r.squaredNorm());
    const double h_change = h * slopes[i].w / errors_[i].w -
                            errors_[i].r.dot(slopes[i].r) +
                            cap2_slope / 2;  // w h, by w
    const double lambda = multipliers()[i];
    // lambda h + h dlambda + lambda dh = mu
    const double newton = (mu() - lambda * h_change) / h;
    const double central = mu() / SlackOf(stepped[i]);
    multipliers()[i] =
        std::clamp(std::max(newton, kBoundaryShare * lambda),
                   central / kMultiplierRange, central * kMultiplierRange);
  }
}

double BarrierPath::Step() {
  const AdjustmentBlocks from = *bounded_.blocks;
  const double highest = BarrierCost(errors_) + kCostRounding * Objective();
  while (radius_ >= kMinRadius) {
    const std::optional<AdjustmentBlocks> trial = FindTrial();
    const std::optional<Errors> slopes =
        trial ? FindSlopes(from, *trial) : std::nullopt;
    bounded_.blocks->cap2 = from.cap2;
    const double cap2_slope = trial ? trial->cap2 - from.cap2 : 0;
    const double longest = slopes ? LongestStep(*slopes, cap2_slope) : 0;
    for (double step = longest; step > kShortestStep; step *= kShortening) {
      std::optional<Errors> stepped = ProjectAt(from, *trial, step);
      if (!stepped || !(BarrierCost(*stepped) <= highest)) continue;
      UpdateMultipliers(*slopes, cap2_slope, *stepped, from.cap2);
      errors_ = std::move(*stepped);
      cost_ = HalfSquaredNorm(errors_);
      UpdateRadius(step / longest);
      return step;
    }
    *bounded_.blocks = from;
    radius_ /= 100;
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
  set_mu(std::max(last, kCentering * mu()));
}

int64_t BarrierPath::NumActive() const {
  int64_t count = 0;
  for (const ProjectedError& error : errors_) {
    if (mu() / SlackOf(error) > kActiveMultiplier) ++count;
  }
  return count;
}

}  // namespace krot
