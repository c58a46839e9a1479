#include "krot/problem/cost.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"

namespace krot::internal {
ViewedPoint ViewPoint(const KnownRotationProblem& problem,
                      const Observation& observation,
                      const Estimate& estimate) {
  const View& view = problem.views[observation.view];
  return ViewPoint(CamFromWorld(view, estimate.translations[view.frame]),
                   observation, estimate.points[observation.point]);
}

double MedianDepth(const KnownRotationProblem& problem,
                   const Estimate& estimate) {
  std::vector<double> depths;
  depths.reserve(problem.observations.size());
  for (const Observation& observation : problem.observations) {
    depths.push_back(ViewPoint(problem, observation, estimate).depth);
  }
  return Median(std::move(depths));
}

double ResidualAbove(double level, const KnownRotationProblem& problem,
                     const std::vector<AffineMap>& cameras,
                     const std::vector<Eigen::Vector3d>& points, Norm norm,
                     int64_t begin, int64_t end) {
  double largest = 0;
  for (int64_t i = begin; i < end && largest <= level; ++i) {
    const Observation& observation = problem.observations[i];
    const ViewedPoint viewed = ViewPoint(cameras[observation.view], observation,
                                         points[observation.point]);
    largest = std::max(largest, ResidualOf(viewed, norm));
  }
  return largest;
}

double PointCost(const KnownRotationProblem& problem, const Estimate& estimate,
                 Norm norm, int64_t point) {
  double cost = 0;
  for (int64_t i = problem.point_begin[point];
       i < problem.point_begin[point + 1]; ++i) {
    const ViewedPoint viewed =
        ViewPoint(problem, problem.observations[i], estimate);
    cost = std::max(cost, ResidualOf(viewed, norm));
  }
  return cost;
}

double FrameCost(const KnownRotationProblem& problem, const Estimate& estimate,
                 Norm norm, int64_t frame) {
  double cost = 0;
  for (int64_t n = problem.frame_begin[frame];
       n < problem.frame_begin[frame + 1]; ++n) {
    const ViewedPoint viewed = ViewPoint(
        problem, problem.observations[problem.frame_observations[n]], estimate);
    cost = std::max(cost, ResidualOf(viewed, norm));
  }
  return cost;
}

bool AllDepthsPositive(const KnownRotationProblem& problem,
                       const Estimate& estimate, int num_threads) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate.translations);
  std::atomic<bool> all_positive{true};
  ParallelForEach(
      static_cast<int64_t>(problem.observations.size()), num_threads,
      [&](int64_t i) {
        const Observation& o = problem.observations[i];
        if (!(ViewPoint(cameras[o.view], o, estimate.points[o.point]).depth >
              0)) {
          all_positive = false;
        }
      });
  return all_positive;
}

double Cost(const KnownRotationProblem& problem, const Estimate& estimate,
            Norm norm, int num_threads) {
  CheckAtLeast(1, norm.p, "norm.p");
  CheckArgument(
      estimate.translations.size() == static_cast<size_t>(problem.num_frames),
      "estimate.translations.size()", estimate.translations.size(),
      "the number of frames");
  CheckArgument(
      estimate.points.size() == static_cast<size_t>(problem.num_points),
      "estimate.points.size()", estimate.points.size(), "the number of points");

  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate.translations);
  const int64_t count = static_cast<int64_t>(problem.observations.size());
  std::vector<double> chunk_max(NumChunks(count, kItemsPerChunk), 0);
  ParallelFor(
      count, kItemsPerChunk, num_threads, [&](int64_t begin, int64_t end, int) {
        chunk_max[begin / kItemsPerChunk] = ResidualAbove(
            kInfinity, problem, cameras, estimate.points, norm, begin, end);
      });
  return chunk_max.empty()
             ? 0.0
             : *std::max_element(chunk_max.begin(), chunk_max.end());
}

}  // namespace krot::internal
