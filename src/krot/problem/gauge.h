#pragma once

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The freedom that the known rotation problem leaves: every connected
// component may be translated and, unless a baseline fixes its size, scaled
// about any point.
//
// Frame f moves as a whole: if its projection centre C_f shifts by d, then
// t_f' = t_f - R_rw d. A component's scale is fixed as soon as one of its
// frames sees points through two different projection centres.

// Moves `estimate` onto the coordinate frame of `reference`, one component at
// a time, so that the projection centres keep the centroid that they have in
// `reference` and, where the scale is free, the RMS distance to it. Every view
// of a frame counts once, with the centre through which its frame sees points.
// Where all centres of a component coincide (in either estimate), its points
// take their place. What is not finite in `reference` does not count, and a
// component without anything that does stays. The cost does not change. Frames
// and points without an observation stay, and an estimate in the right place
// keeps its bits. O(observations).
void RestoreGauge(const KnownRotationProblem& problem,
                  const Estimate& reference, Estimate* estimate);

// Scales an estimate to a median depth of one: that of a problem without
// baselines (HasBaseline), whose scale is free. O(observations).
void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate);

}  // namespace krot
