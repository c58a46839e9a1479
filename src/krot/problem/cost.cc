#include "krot/problem/cost.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/parallel_for.h"
#include "krot/minimax/residual.h"

namespace krot {
namespace {

constexpr int64_t kObservationsPerChunk = 16384;

}  // namespace

ViewedPoint ViewPoint(const KnownRotationProblem& problem,
                      const Observation& observation,
                      const Estimate& estimate) {
  const View& view = problem.views[observation.view];
  const Eigen::Vector3d x_cam =
      view.cam_from_world_rotation * estimate.points[observation.point] +
      view.cam_from_rig_rotation * estimate.translations[view.frame] +
      view.cam_from_rig_translation;
  return {x_cam.z(),
          observation.J * (x_cam.head<2>() - observation.u * x_cam.z())};
}

double ResidualOf(const ViewedPoint& viewed, Norm norm) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!(viewed.depth > 0)) return kInfinity;
  const double residual = NormOf(viewed.v, norm) / viewed.depth;
  return std::isfinite(residual) ? residual : kInfinity;
}

double Cost(const KnownRotationProblem& problem, const Estimate& estimate,
            Norm norm, int num_threads) {
  CheckArgument(norm.p >= 1, "norm.p", norm.p, ">= 1");
  CheckArgument(
      estimate.translations.size() == static_cast<size_t>(problem.num_frames),
      "estimate.translations.size()", estimate.translations.size(),
      "the number of frames");
  CheckArgument(
      estimate.points.size() == static_cast<size_t>(problem.num_points),
      "estimate.points.size()", estimate.points.size(), "the number of points");

  const int64_t count = static_cast<int64_t>(problem.observations.size());
  std::vector<double> chunk_max(NumChunks(count, kObservationsPerChunk), 0);
  ParallelFor(
      count, kObservationsPerChunk, num_threads,
      [&](int64_t begin, int64_t end, int) {
        double largest = 0;
        for (int64_t i = begin; i < end; ++i) {
          const Observation& observation = problem.observations[i];
          largest = std::max(
              largest,
              ResidualOf(ViewPoint(problem, observation, estimate), norm));
        }
        chunk_max[begin / kObservationsPerChunk] = largest;
      });
  return chunk_max.empty()
             ? 0.0
             : *std::max_element(chunk_max.begin(), chunk_max.end());
}

}  // namespace krot
