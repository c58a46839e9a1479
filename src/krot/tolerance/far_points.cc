#include "krot/tolerance/far_points.h"

#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "krot/problem/cost.h"
#include "krot/problem/subset.h"
#include "krot/sweeps/block_sweep.h"

namespace krot {
namespace {

using Eigen::Vector3d;

// All cameras in one place: a point is a direction.
KnownRotationProblem WithoutPositions(KnownRotationProblem problem) {
  for (View& view : problem.views) view.cam_from_rig_translation.setZero();
  problem.fixed_translations.clear();
  problem.fixed_points.clear();
  return problem;
}

// The sum of the unit rays.
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

}  // namespace krot
