#include "krot/tolerance/pull_coefficients.h"

namespace krot {

// C = -R_cw'(R_sr t_f + t_sr).
BlockVector CoefficientsOf(const KnownRotationProblem& problem,
                           const Pull& pull) {
  BlockVector coefficients;
  coefficients.SetZero(problem.num_points, problem.num_frames);
  if (pull.kind == Pull::Kind::kPoint) {
    if (problem.IsFixedPoint(pull.index)) return coefficients;
    coefficients.points[pull.index] = pull.direction;
    return coefficients;
  }
  const View& view = problem.views[pull.index];
  if (problem.IsFixedFrame(view.frame)) return coefficients;
  coefficients.frames[view.frame] =
      -(view.cam_from_rig_rotation.transpose() *
        (view.cam_from_world_rotation * pull.direction));
  return coefficients;
}

}  // namespace krot
