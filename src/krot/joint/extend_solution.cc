#include "krot/joint/joint.h"

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The place with the least sum of squared distances from the rays of the
// point's pixels.
Vector3d NearestToRays(const KnownRotationProblem& problem,
                       const std::vector<AffineMap>& cameras, int64_t point) {
  Matrix3d sum = Matrix3d::Zero();
  Vector3d rhs = Vector3d::Zero();
  for (const int64_t i : problem.OfPoint(point)) {
    const Observation& o = problem.observations[i];
    const AffineMap& camera = cameras[o.view];
    const Vector3d ray_in_camera = o.E.inverse().col(0);
    const Vector3d ray =
        (camera.leftCols<3>().transpose() * ray_in_camera).normalized();
    const Matrix3d across = Matrix3d::Identity() - ray * ray.transpose();
    sum += across;
    rhs += across * CentreOf(camera);
  }
  return sum.ldlt().solve(rhs);
}

// Puts the points that are behind a camera where they are nearest to their
// rays, if that is in front of all.
void PutInFront(const KnownRotationProblem& problem, const Context& context,
                Estimate* estimate) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate->translations);
  ParallelForEach(problem.num_points, context.num_threads, [&](int64_t k) {
    if (problem.IsFixedPoint(static_cast<int32_t>(k))) return;
    const auto is_in_front = [&](const Vector3d& position) {
      for (const int64_t i : problem.OfPoint(k)) {
        const Observation& o = problem.observations[i];
        if (!(ViewPoint(cameras[o.view], o, position).depth > 0)) return false;
      }
      return true;
    };
    if (is_in_front(estimate->points[k])) return;
    const Vector3d nearest = NearestToRays(problem, cameras, k);
    if (nearest.allFinite() && is_in_front(nearest)) {
      estimate->points[k] = nearest;
    }
  });
}

}  // namespace

bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate) {
  PutInFront(problem, context, estimate);
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  DescentGoal goal;
  goal.level = level;
  // Less than the share above which a working set takes points in
  // (component_solve.cc).
  goal.sufficient = 0.7 * level;
  blocks.SetGoal(goal);
  return std::isfinite(blocks.IntersectPoints(estimate));
}

bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate) {
  if (!PlacePoints(problem, norm, context, level, estimate)) return false;
  const auto excess = [&] {
    return MaxOfRanks(context,
                      Cost(problem, *estimate, norm, context.num_threads)) -
           highest;
  };
  double left = excess();
  if (left <= 0) return true;
  // Blocks well below the highest cost allowed stay. Sweeps end where one takes
  // less than a fifth off the excess.
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  blocks.SetGoal({/*tolerance=*/1e-3, /*level=*/0.9 * highest});
  for (int sweep = 0; sweep < 10; ++sweep) {
    blocks.ResectFrames(estimate);
    blocks.IntersectPoints(estimate);
    const double before = std::exchange(left, excess());
    if (left <= 0) return true;
    if (left > 0.8 * before) return false;
  }
  return false;
}

}  // namespace krot::internal
