#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/parallel_for.h"
#include "krot/model/known_distances.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/tolerance/tolerance_analysis.h"

namespace krot::internal {
namespace {

// Finds the least and the greatest length of distances, by a problem of their
// own: its gauge is the scale bar, if there is one and the scale is free.
class LengthFinder {
 public:
  LengthFinder(const ToleranceOptions& options, const ToleranceGauge& gauge,
               const BuiltProblem& built, const Context& context)
      : options_(options), context_(context), gauge_(gauge), built_(built) {}

  void Fill(const Model& model, ToleranceSummary* summary) {
    std::vector<ToleranceLength>& lengths = summary->lengths;
    const std::vector<double> in_model = LengthsOf(model, options_.distances);
    view_of_ = InverseOf(built_.image_of, model.images.size());
    point_of_ = InverseOf(built_.point_of, model.points3D.size());
    for (size_t n = 0; n < options_.distances.size(); ++n) {
      const KnownDistance& distance = options_.distances[n];
      ToleranceLength length;
      length.name = distance.Name(model);
      length.metres = distance.metres;
      length.tolerance = distance.tolerance;
      length.length = in_model[n];
      length.is_free = true;
      lengths.push_back(std::move(length));
      targets_.push_back(TargetsOf(distance));
      if (!bar_ && distance.metres) bar_ = n;
    }
    if (bar_) lengths[*bar_].is_bar = true;
    if (bar_ && !targets_[*bar_]) return;
    if (bar_ && gauge_.first && IsScaleFree(built_.problem)) {
      gauge_ = {(*targets_[*bar_])[0], (*targets_[*bar_])[1]};
    }
    const Estimate centre = built_.start;
    const ToleranceProblem problem(model, &built_, centre, gauge_,
                                   options_.solve.norm, options_.max_error,
                                   context_);
    if (bar_) {
      const LengthRange range = Find(problem, *bar_, context_, summary);
      unit_ = BarUnit{in_model[*bar_], range};
    }
    FillOthers(problem, summary);
  }

 private:
  // What lengths are divided by to get metres.
  struct BarUnit {
    double in_model = 0;
    LengthRange range;
  };

  std::optional<std::array<Pull, 2>> TargetsOf(
      const KnownDistance& distance) const {
    std::array<Pull, 2> targets;
    for (int side = 0; side < 2; ++side) {
      const KnownDistance::End& end = distance.ends[side];
      const int32_t index = (end.is_image ? view_of_ : point_of_)[end.index];
      if (index < 0) return std::nullopt;
      targets[side] = {end.is_image ? Pull::Kind::kView : Pull::Kind::kPoint,
                       index};
    }
    return targets;
  }

  LengthRange Find(const ToleranceProblem& problem, size_t n,
                   const Context& context, ToleranceSummary* summary) {
    LengthRange range =
        FindLength(problem, *targets_[n],
                   bar_ && n != *bar_ ? targets_[*bar_] : std::nullopt,
                   options_.tolerance, context);
    summary->lengths[n].is_free = !range.low.proved;
    return range;
  }

  void FillOthers(const ToleranceProblem& problem, ToleranceSummary* summary) {
    std::vector<ToleranceLength>& lengths = summary->lengths;
    Context inner = context_;
    if (lengths.size() > 1) inner.num_threads = 1;
    std::vector<int64_t> num_programmes(lengths.size(), 0);
    std::atomic<int64_t> num_done = 0;
    ParallelFor(static_cast<int64_t>(lengths.size()), 1, context_.num_threads,
                [&](int64_t n, int64_t, int) {
                  const bool is_bar = bar_ && static_cast<size_t>(n) == *bar_;
                  if (context_.IsCancelled() || !targets_[n]) return;
                  const LengthRange range =
                      is_bar ? unit_->range : Find(problem, n, inner, summary);
                  num_programmes[n] = range.num_programmes;
                  InMetres(range, &lengths[n]);
                  if (options_.on_box) options_.on_box(++num_done);
                });
    for (const int64_t count : num_programmes) summary->num_programmes += count;
  }

  // Converts a range to metres, each end by the bar's least favourable length.
  void InMetres(const LengthRange& range, ToleranceLength* length) const {
    length->low = range.low;
    length->high = range.high;
    if (!bar_) return;
    constexpr double kOutwards = 4 * std::numeric_limits<double>::epsilon();
    const KnownDistance& bar = options_.distances[*bar_];
    const double least = std::max(*bar.metres - bar.tolerance, 0.0);
    const double most = *bar.metres + bar.tolerance;
    length->length *= *bar.metres / unit_->in_model;
    length->low.reached *= least / unit_->in_model;
    length->high.reached *= most / unit_->in_model;
    const BoxEnd& low_of_bar = unit_->range.low;
    const BoxEnd& high_of_bar = unit_->range.high;
    if (length->is_bar) {
      length->low = {least, least};
      length->high = {most, most};
      return;
    }
    if (!length->low.proved || !high_of_bar.proved ||
        !(*low_of_bar.proved > 0)) {
      length->low.proved = length->high.proved = std::nullopt;
      length->is_free = true;
      return;
    }
    *length->low.proved *= least / *high_of_bar.proved * (1 - kOutwards);
    *length->high.proved *= most / *low_of_bar.proved * (1 + kOutwards);
  }

  const ToleranceOptions& options_;
  const Context& context_;
  ToleranceGauge gauge_;
  BuiltProblem built_;
  std::vector<int32_t> view_of_;
  std::vector<int32_t> point_of_;
  std::vector<std::optional<std::array<Pull, 2>>> targets_;
  std::optional<size_t> bar_;
  std::optional<BarUnit> unit_;
};

}  // namespace

void FillLengths(const ToleranceOptions& options, const Model& model,
                 const ToleranceGauge& gauge, const BuiltProblem& built,
                 const Context& context, ToleranceSummary* summary) {
  LengthFinder(options, gauge, built, context).Fill(model, summary);
}

}  // namespace krot::internal
