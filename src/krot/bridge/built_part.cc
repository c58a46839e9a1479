#include "krot/bridge/built_part.h"

namespace krot::internal {

BuiltProblem BuiltPart(const BuiltProblem& built, const ProblemSubset& subset,
                       const Estimate& start) {
  BuiltProblem part;
  part.problem = subset.problem();
  part.start = subset.Restrict(start);
  part.frame_of.resize(part.problem.num_frames);
  part.image_of.resize(part.problem.views.size());
  part.point_of.resize(part.problem.num_points);
  for (size_t n = 0; n < part.problem.observations.size(); ++n) {
    const int64_t i = subset.InWhole(static_cast<int64_t>(n));
    const Observation& own = part.problem.observations[n];
    const Observation& in_whole = built.problem.observations[i];
    part.frame_of[part.problem.views[own.view].frame] =
        built.frame_of[built.problem.views[in_whole.view].frame];
    part.image_of[own.view] = built.image_of[in_whole.view];
    part.point_of[own.point] = built.point_of[in_whole.point];
    part.point2D_of.push_back(built.point2D_of[i]);
    part.pixels.push_back(built.pixels[i]);
  }
  return part;
}

}  // namespace krot::internal
