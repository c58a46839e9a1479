#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Weights for the next slack programme [Candes, Wakin, Boyd 2008]: an excess
// much below the share `dear` of `bound` costs 1 / dear times as much as one of
// the bound.
inline std::vector<double> WeightsAgainst(const std::vector<double>& excess,
                                          double bound, double dear) {
  std::vector<double> weights;
  weights.reserve(excess.size());
  for (const double own : excess) {
    weights.push_back(dear / (dear + own / bound));
  }
  return weights;
}

// From nothing, pixels: what is an error is known only afterwards.
inline constexpr double kLevelOfStart = 2;
// In levels: what is farther from a point disagrees with it.
inline constexpr double kCapOfPoints = 4;

// Positions from rotations and raw tracks: an estimate of all frames and points
// from nothing, whatever outliers there are. For each connected component,
//
//   1. parts that share few of their tracks with others (parts.h), since
//      one programme holds one mean scale, and what hangs on it by little
//      shrinks for free; and of each part
//   2. the longest tracks, so many that they check every frame many times over
//      and all hang together;
//   3. their slack programme from nothing (conic/interior_point.h), and again
//      with weights that let large errors count less; of a core of frames only
//      where its matrix would fill, and then the other frames, ring by ring;
//   4. the other points where most of their rays agree;
//   5. then the parts, each where a robust sum of squares is least
//      (finish/least_squares.h), are joined.
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
