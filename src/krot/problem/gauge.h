#pragma once

#include "krot/base/context.h"
#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The freedom that the known rotation problem leaves: every connected
// component may be translated and, unless a baseline fixes its size, scaled
// about any point.
//
// Frame f moves as a whole: if its projection centre C_f shifts by d, then
// t_f' = t_f - R_rw d. A component's scale is fixed as soon as one of its
// frames sees points through two different projection centres. A component with
// anything fixed keeps its place, and is free to be scaled about that alone,
// if all that is fixed in it coincides.

// Moves `estimate` onto the coordinate frame of `reference`, one component at
// a time, so that the projection centres keep the centroid that they have in
// `reference` and, where the scale is free, the RMS distance to it. Every view
// of a frame counts once, with the centre through which its frame sees points.
// Where all centres of a component coincide (in either estimate), its points
// take their place. What is not finite in `reference` does not count, and a
// component without anything that does stays. The cost does not change. Frames
// and points without an observation stay, and so does what is fixed, with all
// of its component but for the scale, if that is free: it is that of the RMS
// distance to what is fixed. An estimate in the right place keeps its bits.
// O(observations).
void RestoreGauge(const KnownRotationProblem& problem,
                  const Estimate& reference, Estimate* estimate,
                  const Context& context = {});

// The same, unless it would raise the cost of its own rows, pixels, by more
// than rounding: what is small and near the origin loses its digits elsewhere.
// Then the estimate stays as it is.
void RestoreGaugeIfHarmless(const KnownRotationProblem& problem,
                            const Estimate& reference, Norm norm,
                            const Context& context, Estimate* estimate);

// Scales an estimate to a median depth of one: that of a problem without
// baselines (HasBaseline), whose scale is free. O(observations).
void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate);

}  // namespace krot
