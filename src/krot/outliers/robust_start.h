#pragma once

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// From nothing, pixels: what is an error is known only afterwards.
inline constexpr double kLevelOfStart = 2;
// In levels: what is farther from a point disagrees with it.
inline constexpr double kCapOfPoints = 4;

// Positions from rotations and raw tracks: an estimate of all frames and points
// from nothing, whatever outliers there are. For each connected component,
//
//   1. parts that share few of their tracks with others (weak_links.h), since
//      one programme holds one mean scale, and what hangs on it by little
//      shrinks for free; and of each part
//   2. the longest tracks, so many that they check every frame many times over
//      and all hang together;
//   3. their slack programme from nothing (conic/slack_program.h), and again
//      with weights that let large errors count less;
//   4. the other points where most of their rays agree;
//   5. then the parts, each where a robust sum of squares is least
//      (finish/robust_least_squares.h), are joined.
//
// What exceeds `level`, pixels, counts as an error there. Depths are positive
// but for those of outliers, and their median is one where the scale is free.
Estimate FindRobustStart(const KnownRotationProblem& problem, Norm norm,
                         double level, const Context& context);

// The median error of an estimate, pixels; that of a point behind its camera is
// infinite. 0 without observations. O(observations).
double MedianError(const KnownRotationProblem& problem,
                   const Estimate& estimate, Norm norm);

}  // namespace krot::internal
