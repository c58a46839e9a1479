#include "krot/problem/known_rotation_problem.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "krot/base/check.h"

namespace krot {
namespace {

void CheckIndex(int32_t index, int64_t count, const char* list, int64_t element,
                const char* field) {
  if (index >= 0 && index < count) return;
  CheckArgument(
      false, std::string(list) + "[" + std::to_string(element) + "]." + field,
      index, ">= 0 and < " + std::to_string(count));
}

void CheckIndices(const KnownRotationProblem& problem) {
  CheckArgument(problem.num_frames >= 0, "num_frames", problem.num_frames,
                ">= 0");
  CheckArgument(problem.num_points >= 0, "num_points", problem.num_points,
                ">= 0");
  const int64_t num_views = static_cast<int64_t>(problem.views.size());
  const int64_t num_observations =
      static_cast<int64_t>(problem.observations.size());
  CheckArgument(num_observations <= std::numeric_limits<int32_t>::max(),
                "observations.size()", num_observations, "< 2^31");

  for (int64_t j = 0; j < num_views; ++j) {
    CheckIndex(problem.views[j].frame, problem.num_frames, "views", j, "frame");
  }
  const size_t num_fixed_frames = problem.fixed_translations.size();
  CheckArgument(
      num_fixed_frames == 0 ||
          static_cast<int32_t>(num_fixed_frames) == problem.num_frames,
      "fixed_translations.size()", num_fixed_frames,
      "0 or the number of frames");
  const size_t num_fixed_points = problem.fixed_points.size();
  CheckArgument(
      num_fixed_points == 0 ||
          static_cast<int32_t>(num_fixed_points) == problem.num_points,
      "fixed_points.size()", num_fixed_points, "0 or the number of points");
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

}  // namespace

void IndexObservations(KnownRotationProblem* problem) {
  CheckIndices(*problem);
  const std::vector<Observation>& observations = problem->observations;

  // Counts, one place late; their prefix sums are the ranges.
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

}  // namespace krot
