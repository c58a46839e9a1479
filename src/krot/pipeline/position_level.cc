#include "krot/pipeline/position_level.h"

#include <algorithm>
#include <cmath>

namespace krot::internal {
namespace {

// Of d log G / d log L, which is below 1.
constexpr double kSteepest = 0.98;
// What it counts as at least where the level's excess is chosen.
constexpr double kLeastSlope = 0.5;
// Of the tolerance, whatever the slope seems to be: what is chosen below, and
// some.
constexpr double kMostExcess = 1.25 / kLeastSlope;
// Levels that are nearer to each other, relative, show no slope.
constexpr double kNear = 1e-5;

}  // namespace

std::optional<double> PositionLevel::Next(double level, double optimum,
                                          double cost, double ratio) {
  const bool is_kept = ratio <= 1 + kKeptInRounds;
  // Where no position holds a camera back, the level has no say.
  if (is_kept && level * ratio < (1 - tolerance_) * cost) return std::nullopt;
  if (!(optimum > 0)) return std::nullopt;
  const double x = std::log(level);
  const double y = std::log(optimum);
  if (last_ && std::abs(x - last_->first) > kNear) {
    slope_ = std::min(std::max((y - last_->second) / (x - last_->first), 0.0),
                      kSteepest);
  }
  last_ = {x, y};
  // A level e above the fixed point costs slope e, and leaves (1 - slope) e.
  const double excess = x - std::log(cost);
  if (is_kept && slope_ * excess <= 2 * (1 - slope_) * tolerance_ &&
      excess <= kMostExcess * tolerance_) {
    return std::nullopt;
  }
  // As G rises slower than L, the fixed point is beyond y as seen from x.
  if (y > x) lowest_ = std::max(lowest_, y);
  if (y < x) highest_ = std::min(highest_, y);
  double target = (y - slope_ * x) / (1 - slope_);
  if (lowest_ < highest_) {
    target = std::min(std::max(target, lowest_), highest_);
  }
  return std::exp(target + tolerance_ / std::max(slope_, kLeastSlope));
}

}  // namespace krot::internal
