#include "krot/pipeline/known_positions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/convert/reprojection.h"
#include "krot/pipeline/pixel_proof.h"
#include "krot/pipeline/stages.h"

namespace krot::internal {
namespace {

// Upper limit of the estimated slope d log G / d log L, which is below 1.
constexpr double kSteepest = 0.98;
// The smallest slope that is assumed when choosing how far above the fixed
// point the next level is.
constexpr double kLeastSlope = 0.5;
// A level whose logarithm exceeds that of the cost by more than this times the
// tolerance is never good enough, whatever the slope. It is a quarter more than
// the largest distance above the fixed point that is chosen below.
constexpr double kMostExcess = 1.25 / kLeastSlope;
// Levels that differ by less than this, relative, do not determine a slope.
constexpr double kNear = 1e-5;

}  // namespace

std::optional<double> PositionLevel::Next(double level, double optimum,
                                          double cost, double ratio) {
  const bool is_kept = ratio <= 1 + kKeptInRounds;
  // Where no position holds a camera back, the level does not matter.
  if (is_kept && level * ratio < (1 - tolerance_) * cost) return std::nullopt;
  if (!(optimum > 0)) return std::nullopt;
  const double x = std::log(level);
  const double y = std::log(optimum);
  if (last_ && std::abs(x - last_->first) > kNear) {
    slope_ = std::min(std::max((y - last_->second) / (x - last_->first), 0.0),
                      kSteepest);
  }
  last_ = {x, y};
  // In logarithms: if the level is e above the fixed point, the cost is about
  // slope e above it, so the excess is (1 - slope) e.
  const double excess = x - std::log(cost);
  if (is_kept && slope_ * excess <= 2 * (1 - slope_) * tolerance_ &&
      excess <= kMostExcess * tolerance_) {
    return std::nullopt;
  }
  // As G rises slower than L, the fixed point is beyond y when seen from x.
  if (y > x) lowest_ = std::max(lowest_, y);
  if (y < x) highest_ = std::min(highest_, y);
  double target = (y - slope_ * x) / (1 - slope_);
  if (lowest_ < highest_) {
    target = std::min(std::max(target, lowest_), highest_);
  }
  return std::exp(target + tolerance_ / std::max(slope_, kLeastSlope));
}

namespace {

// Shares of the gap asked for: the tolerance of the level, and how far below
// the cost the levels are at which a proof is tried.
constexpr double kShareOfLevel = 0.2;
constexpr double kSharesOfProof[] = {0.3, 0.6, 0.9};
// The smallest level of the first round, pixels, for a start whose errors are
// almost zero.
constexpr double kLeastLevel = 1e-3;

}  // namespace

KeptPositions::KeptPositions(const Model& model,
                             const SolveModelOptions& options,
                             const Context& context,
                             const Reprojection& reprojection,
                             const Estimate& start, BuiltProblem* built)
    : model_(model),
      options_(options),
      context_(context),
      reprojection_(reprojection),
      built_(*built),
      level_(kShareOfLevel * options.joint.relative_gap) {
  if (!Any()) return;
  built_.position_level = std::max(TrueCost(start), kLeastLevel);
  Keep(start);
}

void KeptPositions::Keep(const Estimate& estimate) {
  if (LargestPositionRatio(built_, estimate) > 1 + kKeptInRounds) return;
  const double cost = TrueCost(estimate);
  if (!(cost < cost_)) return;
  estimate_ = estimate;
  cost_ = cost;
}

bool KeptPositions::TakeLevel(const Estimate& estimate, double optimum,
                              double cost) {
  const std::optional<double> level =
      level_.Next(built_.position_level, optimum, cost,
                  LargestPositionRatio(built_, estimate));
  if (level) SetLevel(estimate, *level);
  return level.has_value();
}

void KeptPositions::SetLevel(const Estimate& estimate, double level) const {
  built_.position_level = level;
  TakePositionRows(built_, estimate, &built_.problem);
}

// Only a bound that is at least the level of the rows it was proved with holds
// for the positions themselves.
std::optional<PixelCertificate> KeptPositions::Refute(
    const Estimate& estimate, const Certificate& rows,
    std::vector<int64_t> support) const {
  if (!(rows.lower_bound >
        std::max(built_.position_level, options_.init_max_error))) {
    return std::nullopt;
  }
  std::optional<PixelCertificate> proof =
      ProveInPixels(model_, built_, estimate, options_.norm, std::move(support),
                    rows.lower_bound, context_);
  if (!proof || !(proof->lower_bound > options_.init_max_error)) {
    return std::nullopt;
  }
  return proof;
}

std::optional<PixelCertificate> KeptPositions::Prove(
    const Estimate& estimate, const std::vector<int64_t>& support,
    double sufficient) const {
  const double level = built_.position_level;
  const double cost = TrueCost(estimate);
  std::optional<PixelCertificate> proof;
  for (const double share : kSharesOfProof) {
    SetLevel(estimate, (1 - share * options_.joint.relative_gap) * cost);
    proof = ProveInPixels(model_, built_, estimate, options_.norm, support,
                          sufficient, context_);
    if (proof) break;
  }
  SetLevel(estimate, level);
  return proof;
}

namespace {

// The bracket of the factor is narrow enough at this width, relative.
constexpr double kBracketWidth = 1e-3;
// A factor is tried beside the place where the root is expected, by this share
// of kBracketWidth, so that it cuts off the longer part of the bracket.
constexpr double kBeside = 0.3;
// Largest relative gap of the solves that narrow the bracket. The smaller it
// is, the fewer factors near the root stay undecided.
constexpr double kGapOnTheWay = 2e-4;
constexpr double kFirstStep = 2;
constexpr double kLargestStep = 16;
constexpr double kLargestFactor = 1e6;
constexpr int kMaxFactors = 30;

// Brackets the smallest factor at which the lowest maximum is at most the bound
// asked for. All in logarithms: x is that of the factor, y that of the lowest
// maximum over the bound asked for, so that y = 0 is searched.
class FactorBracket {
 public:
  double lowest() const { return lowest_; }
  double highest() const { return highest_; }
  bool IsClosed() const { return highest_ - lowest_ <= kBracketWidth; }

  // Adds a solve at `x` that proved `bound` and reached `cost`.
  void Add(double x, double bound, double cost) {
    if (cost <= 0) {
      highest_ = std::min(highest_, x);
    } else if (bound > 0) {
      lowest_ = std::max(lowest_, x);
    } else {
      open_.push_back(x);
    }
    const double y = std::isfinite(cost) ? cost : bound;
    if (!std::isfinite(y)) return;
    if (last_ && (y < last_->second) == (x > last_->first)) {
      slope_ = (y - last_->second) / (x - last_->first);
    }
    last_ = {x, y};
  }

  // Where to solve next; none if another solve would not narrow the bracket.
  std::optional<double> Next() const {
    if (IsClosed()) return std::nullopt;
    if (!open_.empty()) return BesideOpen();
    if (!last_) return std::nullopt;
    const auto& [x, y] = *last_;
    if (!std::isfinite(highest_)) {
      const double step = slope_ < 0 ? -y / slope_ + kBeside * kBracketWidth
                                     : std::log(kFirstStep);
      return x +
             std::min(std::max(step, kBracketWidth), std::log(kLargestStep));
    }
    const double width = highest_ - lowest_;
    if (!(slope_ < 0)) return lowest_ + width / 2;
    const double root = x - y / slope_;
    const double shift = root - lowest_ > highest_ - root ? -kBeside : kBeside;
    return std::clamp(root + shift * kBracketWidth, lowest_ + width / 20,
                      highest_ - width / 20);
  }

 private:
  // Where solves were undecided: halfway from them to the nearest place where
  // the answer is known.
  std::optional<double> BesideOpen() const {
    const auto [first, last] = std::minmax_element(open_.begin(), open_.end());
    const double below = *first - lowest_;
    const double above = std::min(highest_ - *last, std::log(kFirstStep));
    if (std::max(below, above) <= kBracketWidth / 2) return std::nullopt;
    return below > above ? *first - below / 2 : *last + above / 2;
  }

  double lowest_ = 0;
  double highest_ = kInfinity;
  double slope_ = 0;
  std::optional<std::pair<double, double>> last_;
  std::vector<double> open_;
};

bool HasEstimate(const SolveSummary& summary) {
  return summary.termination != SolveTermination::kInfeasible &&
         summary.termination != SolveTermination::kNoStart &&
         summary.largest_position_ratio <= 1 + kKeptPosition;
}

class PositionInflater {
 public:
  PositionInflater(const SolveModelOptions& options, const Context& context)
      : options_(options),
        context_(context),
        max_error_(*options.inflate_positions_to),
        on_the_way_(options) {
    on_the_way_.inflate_positions_to.reset();
    on_the_way_.describe_certificate = true;
    on_the_way_.finish.finish = Finish::kNone;
    on_the_way_.joint.relative_gap =
        std::min(kGapOnTheWay, options.joint.relative_gap);
    on_the_way_.init_max_error = std::max(options.init_max_error, max_error_);
  }

  SolveModelResult Run(const Model& model) {
    std::optional<double> x = 0;
    for (int n = 0; n < kMaxFactors && x && *x <= std::log(kLargestFactor);
         ++n) {
      if (!Try(model, *x)) break;
      x = bracket_.Next();
    }
    return Result();
  }

 private:
  SolveModelOptions WithFactor(SolveModelOptions options, double x) const {
    for (KnownPosition& position : options.problem.positions) {
      position.region.semi_axes *= std::exp(x);
    }
    return options;
  }

  // False if interrupted.
  bool Try(const Model& model, double x) {
    const bool is_first = !first_;
    SolveModelResult result =
        SolveModel(last_.model.images.empty() ? model : last_.model,
                   WithFactor(on_the_way_, x), context_);
    if (is_first) first_ = result.summary;
    on_the_way_.on_built = nullptr;
    if (context_.IsCancelled()) {
      if (is_first) last_ = std::move(result);
      return false;
    }
    const SolveSummary& summary = result.summary;
    const bool has_estimate = HasEstimate(summary);
    const double bound = summary.lower_bound.value_or(0);
    const double cost = has_estimate ? summary.cost_final : kInfinity;
    bracket_.Add(x, std::log(bound / max_error_), std::log(cost / max_error_));
    if (bound > max_error_ && x == bracket_.lowest()) {
      refutation_ = summary.certificate;
    }
    if (has_estimate) on_the_way_.init = SolveInit::kModel;
    if (x == bracket_.highest() || !std::isfinite(bracket_.highest())) {
      last_ = std::move(result);
    }
    return true;
  }

  // The result of the bracket's upper end, with a finish; the last result if no
  // upper end was found.
  SolveModelResult Result() {
    if (context_.IsCancelled()) return std::move(last_);
    if (!std::isfinite(bracket_.highest())) {
      last_.summary.termination =
          last_.summary.lower_bound.value_or(0) > max_error_
              ? SolveTermination::kInfeasible
              : SolveTermination::kNoStart;
      return std::move(last_);
    }
    SolveModelOptions finished = on_the_way_;
    finished.describe_certificate = options_.describe_certificate;
    finished.finish = options_.finish;
    finished.finish.max_error = max_error_;
    SolveModelResult result = SolveModel(
        last_.model, WithFactor(finished, bracket_.highest()), context_);
    SolveSummary& summary = result.summary;
    summary.init = first_->init;
    summary.cost_initial = first_->cost_initial;
    summary.pixel_error_before = first_->pixel_error_before;
    summary.position_factor = {std::exp(bracket_.highest()),
                               std::exp(bracket_.lowest()), max_error_,
                               std::move(refutation_)};
    return result;
  }

  const SolveModelOptions& options_;
  const Context& context_;
  const double max_error_;
  SolveModelOptions on_the_way_;
  FactorBracket bracket_;
  std::optional<SolveSummary> first_;
  // The result of the bracket's upper end or, without one, of the last solve.
  SolveModelResult last_;
  std::optional<CertificateFile> refutation_;
};

}  // namespace

SolveModelResult SolveWithInflatedPositions(const Model& model,
                                            const SolveModelOptions& options,
                                            const Context& context) {
  CheckArgument(*options.inflate_positions_to > 0, "inflate_positions_to",
                *options.inflate_positions_to, "> 0");
  CheckArgument(!options.problem.positions.empty(), "problem.positions", "none",
                "some with inflate_positions_to");
  return PositionInflater(options, context).Run(model);
}

}  // namespace krot::internal
