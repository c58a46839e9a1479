#include "krot/problem/cost.h"

#include <algorithm>
#include <atomic>
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

bool AllDepthsPositive(const KnownRotationProblem& problem,
                       const Estimate& estimate, int num_threads) {
  // Per view: depth = axis's + offset.
  struct DepthRow {
    Eigen::Vector3d axis;
    double offset;
  };
  std::vector<DepthRow> rows;
  rows.reserve(problem.views.size());
  for (const View& view : problem.views) {
    rows.push_back({view.cam_from_world_rotation.row(2),
                    view.cam_from_rig_rotation.row(2).dot(
                        estimate.translations[view.frame]) +
                        view.cam_from_rig_translation.z()});
  }
  const int64_t count = static_cast<int64_t>(problem.observations.size());
  std::atomic<bool> all_positive{true};
  ParallelFor(count, kObservationsPerChunk, num_threads,
              [&](int64_t begin, int64_t end, int) {
                if (!all_positive) return;
                bool positive = true;
                for (int64_t i = begin; i < end; ++i) {
                  const Observation& observation = problem.observations[i];
                  const DepthRow& row = rows[observation.view];
                  positive &= row.axis.dot(estimate.points[observation.point]) +
                                  row.offset >
                              0;
                }
                if (!positive) all_positive = false;
              });
  return all_positive;
}

double LargestResidual(const KnownRotationProblem& problem,
                       const Estimate& estimate, Norm norm, int64_t begin,
                       int64_t end) {
  double largest = 0;
  for (int64_t i = begin; i < end; ++i) {
    const ViewedPoint viewed =
        ViewPoint(problem, problem.observations[i], estimate);
    largest = std::max(largest, ResidualOf(viewed, norm));
  }
  return largest;
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
  ParallelFor(count, kObservationsPerChunk, num_threads,
              [&](int64_t begin, int64_t end, int) {
                chunk_max[begin / kObservationsPerChunk] =
                    LargestResidual(problem, estimate, norm, begin, end);
              });
  return chunk_max.empty()
             ? 0.0
             : *std::max_element(chunk_max.begin(), chunk_max.end());
}

}  // namespace krot
