#include "krot/problem/known_rotation_problem.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

void CheckIndex(int32_t index, int64_t count, const char* list, int64_t element,
                const char* field) {
  if (index >= 0 && index < count) return;
  CheckArgument(
      false, std::string(list) + "[" + std::to_string(element) + "]." + field,
      index, ">= 0 and < " + std::to_string(count));
}

void CheckIndices(const KnownRotationProblem& problem) {
  CheckAtLeast(0, problem.num_frames, "num_frames");
  CheckAtLeast(0, problem.num_points, "num_points");
  const int64_t num_views = static_cast<int64_t>(problem.views.size());
  const int64_t num_observations =
      static_cast<int64_t>(problem.observations.size());
  CheckArgument(num_observations <= std::numeric_limits<int32_t>::max(),
                "observations.size()", num_observations, "< 2^31");

  for (int64_t j = 0; j < num_views; ++j) {
    CheckIndex(problem.views[j].frame, problem.num_frames, "views", j, "frame");
  }
  const auto check_fixed = [](size_t size, int32_t count, const char* name,
                              const char* requirement) {
    CheckArgument(size == 0 || static_cast<int32_t>(size) == count, name, size,
                  requirement);
  };
  check_fixed(problem.fixed_translations.size(), problem.num_frames,
              "fixed_translations.size()", "0 or the number of frames");
  check_fixed(problem.fixed_points.size(), problem.num_points,
              "fixed_points.size()", "0 or the number of points");
  int32_t previous_point = 0;
  for (int64_t i = 0; i < num_observations; ++i) {
    const Observation& observation = problem.observations[i];
    CheckIndex(observation.view, num_views, "observations", i, "view");
    CheckIndex(observation.point, problem.num_points, "observations", i,
               "point");
    if (observation.point < previous_point) {
      CheckArgument(false, "observations[" + std::to_string(i) + "].point",
                    observation.point,
                    ">= " + std::to_string(previous_point) +
                        ", the point of the observation before it");
    }
    previous_point = observation.point;
  }
}

using Eigen::Vector3d;

// Calls visit(x) for every fixed position in the world, views before points.
template <typename Visit>
void ForFixedPositions(const KnownRotationProblem& problem,
                       const Visit& visit) {
  for (const View& view : problem.views) {
    if (!problem.IsFixedFrame(view.frame)) continue;
    visit(
        CentreOf(CamFromWorld(view, *problem.fixed_translations[view.frame])));
  }
  for (const std::optional<Vector3d>& x : problem.fixed_points) {
    if (x) visit(*x);
  }
}

}  // namespace

Estimate Between(const Estimate& from, const Estimate& to, double share) {
  Estimate between = from;
  const auto blend = [&](const std::vector<Vector3d>& other,
                         std::vector<Vector3d>* own) {
    for (size_t n = 0; n < own->size(); ++n) {
      (*own)[n] += share * (other[n] - (*own)[n]);
    }
  };
  blend(to.translations, &between.translations);
  blend(to.points, &between.points);
  return between;
}

void IndexObservations(KnownRotationProblem* problem) {
  CheckIndices(*problem);
  const std::vector<Observation>& observations = problem->observations;

  // Counts are stored one place late, so that their prefix sums are the ranges.
  problem->point_begin.assign(problem->num_points + 1, 0);
  problem->frame_begin.assign(problem->num_frames + 1, 0);
  for (const Observation& observation : observations) {
    ++problem->point_begin[observation.point + 1];
    ++problem->frame_begin[problem->views[observation.view].frame + 1];
  }
  std::partial_sum(problem->point_begin.begin(), problem->point_begin.end(),
                   problem->point_begin.begin());
  std::partial_sum(problem->frame_begin.begin(), problem->frame_begin.end(),
                   problem->frame_begin.begin());

  problem->frame_observations.resize(observations.size());
  std::vector<int64_t> next(problem->frame_begin.begin(),
                            problem->frame_begin.end() - 1);
  for (size_t i = 0; i < observations.size(); ++i) {
    const int32_t frame = problem->views[observations[i].view].frame;
    problem->frame_observations[next[frame]++] = static_cast<int32_t>(i);
  }
}

Eigen::Matrix3d RowAtRay(const Eigen::Vector2d& u, const Eigen::Matrix2d& J) {
  Eigen::Matrix3d E;
  E.row(0) = Eigen::RowVector3d::UnitZ();
  E.bottomRows<2>() << J, -J * u;
  return E;
}

bool HasBaseline(const KnownRotationProblem& problem) {
  return std::any_of(problem.views.begin(), problem.views.end(),
                     [](const View& view) {
                       return !view.cam_from_rig_translation.isZero(0);
                     });
}

bool HasFixed(const KnownRotationProblem& problem) {
  const auto has_any = [](const std::vector<std::optional<Vector3d>>& fixed) {
    return std::any_of(fixed.begin(), fixed.end(),
                       [](const auto& x) { return x.has_value(); });
  };
  return has_any(problem.fixed_translations) || has_any(problem.fixed_points);
}

std::optional<Vector3d> FixedOrigin(const KnownRotationProblem& problem) {
  std::optional<Vector3d> origin;
  ForFixedPositions(problem, [&](const Vector3d& x) {
    if (!origin) origin = x;
  });
  return origin;
}

double FixedExtent(const KnownRotationProblem& problem) {
  const std::optional<Vector3d> origin = FixedOrigin(problem);
  if (!origin) return 0;
  double extent = 0;
  ForFixedPositions(problem, [&](const Vector3d& x) {
    extent = std::max(extent, (x - *origin).norm());
  });
  return extent > 1e-12 * origin->norm() ? extent : 0;
}

bool IsScaleFree(const KnownRotationProblem& problem) {
  return !HasBaseline(problem) && FixedExtent(problem) == 0;
}

Estimate AllAtOrigin(const KnownRotationProblem& problem) {
  Estimate estimate;
  estimate.translations.assign(problem.num_frames, Vector3d::Zero());
  estimate.points.assign(problem.num_points, Vector3d::Zero());
  const std::optional<Vector3d> origin = FixedOrigin(problem);
  if (!origin) return estimate;
  for (const View& view : problem.views) {  // t = -R_rw C
    estimate.translations[view.frame] =
        -(view.cam_from_rig_rotation.transpose() *
          (view.cam_from_world_rotation * *origin));
  }
  estimate.points.assign(problem.num_points, *origin);
  PutFixed(problem, &estimate);
  return estimate;
}

void PutFixed(const KnownRotationProblem& problem, Estimate* estimate) {
  const auto put = [](const std::vector<std::optional<Vector3d>>& fixed,
                      std::vector<Vector3d>* positions) {
    for (size_t n = 0; n < fixed.size(); ++n) {
      if (fixed[n]) (*positions)[n] = *fixed[n];
    }
  };
  put(problem.fixed_translations, &estimate->translations);
  put(problem.fixed_points, &estimate->points);
}

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
  return ParallelMax(count, num_threads, [&](int64_t i) {
    const Observation& o = problem.observations[i];
    return ResidualOf(ViewPoint(cameras[o.view], o, estimate.points[o.point]),
                      norm);
  });
}

}  // namespace krot::internal
