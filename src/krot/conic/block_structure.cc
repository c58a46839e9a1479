#include "krot/conic/block_structure.h"

#include "krot/problem/components.h"

namespace krot {

BlockStructure AnchoredStructure(const KnownRotationProblem& problem) {
  BlockStructure structure;
  structure.point_begin = problem.point_begin;
  structure.frame_of.reserve(problem.observations.size());
  for (const Observation& observation : problem.observations) {
    structure.frame_of.push_back(problem.views[observation.view].frame);
  }
  const auto count = [&](int32_t f) {
    return problem.frame_begin[f + 1] - problem.frame_begin[f];
  };
  const Components components = FindComponents(problem);
  std::vector<int32_t> anchor(components.count, -1);
  structure.frame_is_fixed.assign(problem.num_frames, 0);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (components.of_frame[f] < 0) {
      structure.frame_is_fixed[f] = 1;
      continue;
    }
    int32_t& best = anchor[components.of_frame[f]];
    if (best < 0 || count(f) > count(best)) best = f;
  }
  for (const int32_t f : anchor) structure.frame_is_fixed[f] = 1;
  return structure;
}

}  // namespace krot
