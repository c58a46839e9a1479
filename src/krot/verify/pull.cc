#include "krot/verify/pull.h"

#include "krot/geometry.h"
#include "krot/problem/cost.h"

namespace krot::internal {

using Eigen::Vector3d;

Vector3d PositionOf(const KnownRotationProblem& problem,
                    const Estimate& estimate, const Pull& pull) {
  if (pull.kind == Pull::Kind::kPoint) return estimate.points[pull.index];
  const View& view = problem.views[pull.index];
  return Center({view.cam_from_world_rotation,
                 CamFromWorld(view, estimate.translations[view.frame]).col(3)});
}

double Along(const KnownRotationProblem& problem, const Estimate& estimate,
             const Pull& pull) {
  return pull.direction.dot(PositionOf(problem, estimate, pull));
}

bool IsFixedPosition(const KnownRotationProblem& problem, const Pull& pull) {
  return pull.kind == Pull::Kind::kPoint
             ? problem.IsFixedPoint(pull.index)
             : problem.IsFixedFrame(problem.views[pull.index].frame);
}

std::optional<Pull> InPart(const ProblemSubset& part, const Pull& pull) {
  const std::optional<int32_t> index = pull.kind == Pull::Kind::kPoint
                                           ? part.FindPoint(pull.index)
                                           : part.FindView(pull.index);
  if (!index) return std::nullopt;
  return Pull{pull.kind, *index, pull.direction};
}

}  // namespace krot::internal
