#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Weights for the next slack programme [Candes, Wakin, Boyd 2008]: an excess
// that is small against `dear` times `bound` costs 1 / dear times as much, per
// pixel, as one of the size of the bound.
inline std::vector<double> WeightsAgainst(const std::vector<double>& excess,
                                          double bound, double dear) {
  std::vector<double> weights;
  weights.reserve(excess.size());
  for (const double own : excess) {
    weights.push_back(dear / (dear + own / bound));
  }
  return weights;
}

// The level of a start from nothing, pixels. Which observations are wrong is
// known only afterwards.
inline constexpr double kLevelOfStart = 2;
// In units of the level: observations with larger errors disagree with a point.
inline constexpr double kCapOfPoints = 4;

// Finds positions of all frames and points from rotations and raw tracks,
// whatever outliers there are. For each connected component,
//
//   1. parts that share few of their tracks with others (parts.h) are placed
//      apart, since a programme holds only the mean scale, and what is weakly
//      tied would shrink at no cost; of each part
//   2. the longest tracks are taken, enough to check every frame many times
//      over and to connect them all;
//   3. their slack programme is solved from nothing (conic/interior_point.h),
//      and again with weights by which large errors count less; where its
//      matrix would fill, of a core of frames, then the others ring by ring;
//   4. the other points go where most of their rays agree;
//   5. several parts move to minima of a robust sum of squares
//      (finish/least_squares.h) and are joined.
//
// Errors above `level`, pixels, count as wrong there. Depths are positive but
// for those of outliers, and their median is one where the scale is free.
Estimate FindRobustStart(const KnownRotationProblem& problem, Norm norm,
                         double level, const Context& context);

// The median error of an estimate, pixels; that of a point behind its camera is
// infinite. 0 without observations. O(observations).
double MedianError(const KnownRotationProblem& problem,
                   const Estimate& estimate, Norm norm);

}  // namespace krot::internal
