#include "krot/pipeline/trust_regions.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using Basis = Eigen::Matrix<double, 2, 3>;

constexpr double kShareOfWay = 0.5;

Vector3d InCamera(const KnownRotationProblem& problem, const Estimate& estimate,
                  const Observation& observation) {
  const View& view = problem.views[observation.view];
  const AffineMap map = CamFromWorld(view, estimate.translations[view.frame]);
  return map.leftCols<3>() * estimate.points[observation.point] + map.col(3);
}

// Orthonormal basis of the plane across the ray of x_hat.
Basis BasisAcross(const Vector3d& x_hat) {
  const Vector3d n = x_hat.normalized();
  const Vector3d b1 = n.unitOrthogonal();
  Basis basis;
  basis << b1.transpose(), n.cross(b1).transpose();
  return basis;
}

}  // namespace

int64_t TrustRegions::Shrink(const Reprojection& reprojection,
                             const KnownRotationProblem& problem,
                             const Estimate& from, const Estimate& to,
                             Norm norm, double level) {
  int64_t count = 0;
  const auto num_observations =
      static_cast<int64_t>(problem.observations.size());
  for (int64_t i = 0; i < num_observations; ++i) {
    if (!reprojection.IsOfModel(i) ||
        !(reprojection.Error(to, norm, i) > level))
      continue;
    const Observation& observation = problem.observations[i];
    const Basis basis = BasisAcross(InCamera(problem, from, observation));
    const Vector3d x_cam = InCamera(problem, to, observation);
    const double way = (basis * x_cam).norm() / observation.E.row(0).dot(x_cam);
    const auto [entry, is_new] = radii_.emplace(i, kShareOfWay * way);
    if (!is_new) entry->second = kShareOfWay * std::min(entry->second, way);
    ++count;
  }
  return count;
}

KnownRotationProblem TrustRegions::AddTo(
    const KnownRotationProblem& rows, const Estimate& x_hat, double level,
    std::vector<int64_t>* observation_of) const {
  KnownRotationProblem problem = rows;
  problem.observations.clear();
  observation_of->clear();
  for (int32_t k = 0; k < rows.num_points; ++k) {
    const int64_t begin = rows.point_begin[k];
    const int64_t end = rows.point_begin[k + 1];
    for (int64_t i = begin; i < end; ++i) {
      problem.observations.push_back(rows.observations[i]);
      observation_of->push_back(i);
    }
    for (auto bound = radii_.lower_bound(begin);
         bound != radii_.end() && bound->first < end; ++bound) {
      Observation row = rows.observations[bound->first];
      row.E.bottomRows<2>() =
          level / bound->second * BasisAcross(InCamera(rows, x_hat, row));
      problem.observations.push_back(row);
      observation_of->push_back(-1);
    }
  }
  IndexObservations(&problem);
  return problem;
}

namespace {

// Line searches try a step of 1, then steps shorter by this factor each.
constexpr double kShorter = 0.7;
constexpr double kShortestStep = 1e-3;

}  // namespace

Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, const Context& context,
                       double* step) {
  const auto cost_of = [&](const Estimate& estimate) {
    return MaxOfRanks(context, reprojection.LevelledCost(estimate, norm,
                                                         context.num_threads));
  };
  Estimate best = from;
  double best_cost = cost_of(from);
  *step = 0;
  for (double trial = 1; trial >= kShortestStep; trial *= kShorter) {
    Estimate candidate = trial == 1 ? to : Between(from, to, trial);
    const double cost = cost_of(candidate);
    if (cost < best_cost) {
      best = std::move(candidate);
      best_cost = cost;
      *step = trial;
    } else if (*step > 0) {
      break;
    }
  }
  return best;
}

Estimate BestPointsOnSegments(const Reprojection& reprojection,
                              const KnownRotationProblem& problem,
                              const Estimate& from, const Estimate& to,
                              Norm norm, int num_threads) {
  Estimate best = to;
  const auto cost_of = [&](int64_t k) {
    double cost = 0;
    for (const int64_t i : problem.OfPoint(k)) {
      cost = std::max(cost, reprojection.Error(best, norm, i));
    }
    return cost;
  };
  ParallelForEach(problem.num_points, num_threads, [&](int64_t k) {
    best.points[k] = from.points[k];
    const double before = cost_of(k);
    double step = 1;
    do {
      best.points[k] =
          step == 1 ? to.points[k]
                    : from.points[k] + step * (to.points[k] - from.points[k]);
      step *= kShorter;
    } while (cost_of(k) > before && step >= kShortestStep);
    if (cost_of(k) > before) best.points[k] = from.points[k];
  });
  return best;
}

}  // namespace krot::internal
