#include "krot/problem/fixed.h"

#include <algorithm>
#include <vector>

#include "krot/geometry/rigid_transform.h"

namespace krot {
namespace {

using Eigen::Vector3d;

// Positions closer than this, relative to the size of their coordinates,
// coincide.
constexpr double kSamePosition = 1e-12;

Vector3d CentreOf(const View& view, const Vector3d& translation) {
  return Center(
      {view.cam_from_world_rotation, view.cam_from_rig_rotation * translation +
                                         view.cam_from_rig_translation});
}

// Calls visit(x) for every fixed position in the world, views before points.
template <typename Visit>
void ForFixedPositions(const KnownRotationProblem& problem,
                       const Visit& visit) {
  for (const View& view : problem.views) {
    if (!problem.IsFixedFrame(view.frame)) continue;
    visit(CentreOf(view, *problem.fixed_translations[view.frame]));
  }
  for (const std::optional<Vector3d>& x : problem.fixed_points) {
    if (x) visit(*x);
  }
}

}  // namespace

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
  return extent > kSamePosition * origin->norm() ? extent : 0;
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

}  // namespace krot
