#pragma once

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Moves points and frames to a local minimum of
//
//   sum_i c^2 r_i^2 / (c^2 + r_i^2),   c twice the median of the r_i,
//
// with r_i the residuals in pixels (p = 2) [Geman, McClure 1987], by Gauss and
// Newton's method with weights (c^2 / (c^2 + r_i^2))^2. c is taken anew after
// every step, at first as sixteen times the median, and half as many each time
// [Blake, Zisserman 1987]. An observation that does not see its point counts
// c^2; a point that none sees stays. Steps are damped by the relative changes
// of the depths, so that neither the scale nor what the observations hardly
// hold runs away:
//
//   sum_i weight_i (|r_i + dr_i|^2 + (damping c dw_i / w_i)^2).
//
// The problem may have several components and must have nothing fixed. Ends
// where a step lowers the sum by less than 0.03 %, at the latest after 30. If
// most observations do not see their points, nothing moves. The same bits at
// any number of threads. O(observations) and a factorisation of the frames'
// system a step.
void MinimizeRobustly(const KnownRotationProblem& problem,
                      const Context& context, Estimate* estimate);

}  // namespace krot::internal
