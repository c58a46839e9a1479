#pragma once

#include <algorithm>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// A depth, in scene units, that is small against the scene: what FindFeasible
// keeps points in front by. Where no baseline sets a scale, any will do.
inline double UnitDepth(const KnownRotationProblem& problem) {
  constexpr double kPerBaseline = 1e-2;
  double longest = 0;
  for (const View& view : problem.views) {
    longest = std::max(longest, view.cam_from_rig_translation.norm());
  }
  return longest > 0 ? kPerBaseline * longest : 1;
}

}  // namespace krot
