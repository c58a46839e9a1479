#include "krot/tolerance/tolerance_problem.h"

#include <algorithm>
#include <utility>

#include "krot/bridge/outer_rows.h"
#include "krot/problem/components.h"
#include "krot/problem/fixed.h"
#include "krot/tolerance/far_points.h"

namespace krot {
namespace {

using Eigen::Vector3d;

Vector3d CentreAt(const KnownRotationProblem& problem, const Estimate& estimate,
                  int32_t view) {
  return PositionOf(problem, estimate, {Pull::Kind::kView, view});
}

}  // namespace

ToleranceGauge ChooseGauge(const KnownRotationProblem& problem,
                           const Estimate& estimate) {
  std::vector<int64_t> counts(problem.views.size(), 0);
  for (const Observation& o : problem.observations) ++counts[o.view];
  ToleranceGauge gauge;
  gauge.first = static_cast<int32_t>(
      std::max_element(counts.begin(), counts.end()) - counts.begin());
  if (HasBaseline(problem)) return gauge;
  const Components components = FindComponents(problem);
  const auto component = [&](int32_t v) {
    return components.of_frame[problem.views[v].frame];
  };
  const Vector3d at_first = CentreAt(problem, estimate, *gauge.first);
  double farthest = 0;
  for (int32_t v = 0; v < static_cast<int32_t>(counts.size()); ++v) {
    if (counts[v] == 0 || component(v) != component(*gauge.first)) continue;
    const double distance = (CentreAt(problem, estimate, v) - at_first).norm();
    if (distance <= farthest) continue;
    farthest = distance;
    gauge.second = v;
  }
  return gauge;
}

std::vector<int64_t> HeldObservations(const KnownRotationProblem& problem,
                                      std::vector<int64_t> observations) {
  std::vector<int64_t> held;
  for (const std::vector<int64_t>& component :
       SplitIntoComponents(problem, std::move(observations))) {
    if (!HasFixed(ProblemSubset(problem, component).problem())) continue;
    held.insert(held.end(), component.begin(), component.end());
  }
  std::sort(held.begin(), held.end());
  return held;
}

ToleranceProblem::ToleranceProblem(const Model& model, BuiltProblem* built,
                                   const Estimate& centre,
                                   const ToleranceGauge& gauge, Norm norm,
                                   double bound, const Context& context)
    : model_(model),
      built_(*built),
      centre_(centre),
      norm_(norm),
      bound_(bound) {
  KnownRotationProblem& problem = built->problem;
  if (gauge.first) {
    const int32_t frame = problem.views[*gauge.first].frame;
    problem.fixed_translations.resize(problem.num_frames);
    problem.fixed_translations[frame] = centre.translations[frame];
  }
  if (gauge.first && gauge.second && IsScaleFree(problem)) {
    scale_ = ScaleRow{Pull::Kind::kView, *gauge.second};
    scale_->direction = (CentreAt(problem, centre, *gauge.second) -
                         CentreAt(problem, centre, *gauge.first))
                            .normalized();
  }
  has_row_ =
      TakeOuterRows(model, *built, norm, bound, context.num_threads, &problem);
  num_rowless_ = std::count(has_row_.begin(), has_row_.end(), char{0});
  is_far_ = FindFarPoints(problem, norm, bound, context);
  num_far_points_ = std::count(is_far_.begin(), is_far_.end(), char{1});
}

std::optional<ProblemSubset> ToleranceProblem::UsablePart(
    const Pull& target) const {
  const KnownRotationProblem& whole = problem();
  std::vector<int64_t> usable;
  for (size_t i = 0; i < whole.observations.size(); ++i) {
    const int32_t point = whole.observations[i].point;
    const bool is_target =
        target.kind == Pull::Kind::kPoint && target.index == point;
    if (!has_row_[i] || (is_far_[point] && !is_target)) continue;
    usable.push_back(static_cast<int64_t>(i));
  }
  ProblemSubset part(whole, HeldObservations(whole, std::move(usable)));
  if (!InPart(part, target) || (scale_ && !InPart(part, *scale_))) {
    return std::nullopt;
  }
  return std::optional<ProblemSubset>(std::move(part));
}

}  // namespace krot
