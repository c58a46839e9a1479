#pragma once

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Moves `estimate` onto the coordinate frame of `reference`, one connected
// component of frames and points at a time: a translation and, where every
// baseline t_sr of the component is zero, a scale, so that the camera centres
// (the points, where all centres coincide) keep the centroid and the RMS
// distance to it that they have in `reference`. The cost does not change.
// O(observations).
void RestoreGauge(const KnownRotationProblem& problem,
                  const Estimate& reference, Estimate* estimate);

// Connected components of the graph of frames and points that the
// observations span.
struct Components {
  int count = 0;
  std::vector<int32_t> of_frame;  // -1: the frame has no observation
  std::vector<int32_t> of_point;
};
Components FindComponents(const KnownRotationProblem& problem);

}  // namespace krot
