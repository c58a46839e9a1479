#include "krot/pipeline/inflate_positions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/bridge/position_rows.h"

namespace krot::internal {
namespace {

// Of the bracket, relative.
constexpr double kBracketWidth = 1e-3;
// Of it, how far beside the place where it is believed to be a factor is tried.
constexpr double kBeside = 0.3;
// Of solves on the way; the less they leave open, the narrower the bracket.
constexpr double kGapOnTheWay = 2e-4;
constexpr double kFirstStep = 2;
constexpr double kLargestStep = 16;
constexpr double kLargestFactor = 1e6;
constexpr int kMaxFactors = 30;

// All in logarithms: what is known of the lowest maximum as a function of the
// factor, less that of the bound asked for.
class FactorBracket {
 public:
  double lowest() const { return lowest_; }
  double highest() const { return highest_; }
  bool IsClosed() const { return highest_ - lowest_ <= kBracketWidth; }

  // A solve at `x` that proved `bound` and reached `cost`.
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

  // Where to solve next; none if it would decide nothing.
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
  // Half-way to what is decided, from where nothing was.
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

  // That of the upper end, finished; where there is none, the last one.
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
  // Of the bracket's upper end or, without one, the last.
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
