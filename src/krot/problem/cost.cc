#include "krot/problem/cost.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/parallel_for.h"

namespace krot {
namespace {

constexpr int64_t kObservationsPerChunk = 16384;

double VectorNorm(const Eigen::Vector2d& v, double p) {
  if (p == 2) return v.norm();
  if (p == 1) return v.lpNorm<1>();
  const double largest = v.lpNorm<Eigen::Infinity>();
  if (std::isinf(p) || largest == 0) return largest;
  // Scaled, so that no power over- or underflows.
  const Eigen::Vector2d unit = v / largest;
  return largest * std::pow(std::pow(std::abs(unit.x()), p) +
                                std::pow(std::abs(unit.y()), p),
                            1 / p);
}

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

double Residual(const ViewedPoint& viewed, Norm norm) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!(viewed.depth > 0)) return kInfinity;
  const double residual = VectorNorm(viewed.v, norm.p) / viewed.depth;
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
              Residual(ViewPoint(problem, observation, estimate), norm));
        }
        chunk_max[begin / kObservationsPerChunk] = largest;
      });
  return chunk_max.empty()
             ? 0.0
             : *std::max_element(chunk_max.begin(), chunk_max.end());
}

}  // namespace krot
