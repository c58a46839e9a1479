#include "krot/conic/problem_blocks.h"

namespace krot {

BlockStructure StructureOf(const KnownRotationProblem& problem) {
  BlockStructure structure;
  structure.point_begin = problem.point_begin;
  structure.frame_of.reserve(problem.observations.size());
  for (const Observation& observation : problem.observations) {
    structure.frame_of.push_back(problem.views[observation.view].frame);
  }
  structure.frame_is_fixed.assign(problem.num_frames, 0);
  int32_t anchor = 0;
  for (int32_t f = 1; f < problem.num_frames; ++f) {
    if (problem.frame_begin[f + 1] - problem.frame_begin[f] >
        problem.frame_begin[anchor + 1] - problem.frame_begin[anchor]) {
      anchor = f;
    }
  }
  if (problem.num_frames > 0) structure.frame_is_fixed[anchor] = 1;
  return structure;
}

}  // namespace krot
