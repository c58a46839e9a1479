#include "krot/tolerance/pull_coefficients.h"

namespace krot {

// A view's centre moves as its frame's does.
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
  coefficients.frames[view.frame] = pull.direction;
  return coefficients;
}

}  // namespace krot
