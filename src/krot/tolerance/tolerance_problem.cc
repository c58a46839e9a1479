#include "krot/tolerance/tolerance_problem.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "krot/bridge/reprojection.h"
#include "krot/problem/components.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/block_sweep.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Moves all cameras to one place, so that a point matters as a direction only.
KnownRotationProblem WithoutPositions(KnownRotationProblem problem) {
  for (View& view : problem.views) view.cam_from_rig_translation.setZero();
  problem.fixed_translations.clear();
  problem.fixed_points.clear();
  return problem;
}

// For each point the sum of its unit rays.
Estimate MeanDirections(const KnownRotationProblem& problem) {
  Estimate estimate;
  estimate.translations.assign(problem.num_frames, Vector3d::Zero());
  estimate.points.assign(problem.num_points, Vector3d::Zero());
  for (const Observation& o : problem.observations) {
    const Vector3d ray = o.E.inverse().col(0);
    estimate.points[o.point] +=
        problem.views[o.view].cam_from_world_rotation.transpose() *
        ray.normalized();
  }
  return estimate;
}

using Eigen::Vector3d;

Vector3d CentreAt(const KnownRotationProblem& problem, const Estimate& estimate,
                  int32_t view) {
  return PositionOf(problem, estimate, {Pull::Kind::kView, view});
}

}  // namespace

std::vector<char> FindFarPoints(const KnownRotationProblem& problem, Norm norm,
                                double bound, const Context& context) {
  const KnownRotationProblem directions = WithoutPositions(problem);
  Estimate estimate = MeanDirections(directions);
  const auto cost = [&](int32_t k) {
    return PointCost(directions, estimate, norm, k);
  };
  std::vector<int64_t> undecided;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (cost(k) < bound || !std::isfinite(cost(k))) continue;
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      undecided.push_back(i);
    }
  }
  const ProblemSubset part(directions, std::move(undecided));
  Estimate lowered = part.Restrict(estimate);
  BlockSweep(part.problem(), FastDescentOptions(), norm, context)
      .IntersectPoints(&lowered);
  part.Replace(lowered, &estimate);
  std::vector<char> is_far(problem.num_points, 0);
  for (int32_t k = 0; k < problem.num_points; ++k) {
    const bool is_seen = problem.point_begin[k] < problem.point_begin[k + 1];
    is_far[k] = is_seen && !problem.IsFixedPoint(k) && cost(k) < bound;
  }
  return is_far;
}

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

}  // namespace krot::internal
