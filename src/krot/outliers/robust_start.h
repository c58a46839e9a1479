#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/geometry.h"
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

// Places points where most of their tracks agree, the frames fixed. Candidates
// are the midpoints of pairs of rays, and that of all rays that agree with the
// best of them; the one with the least sum of errors is taken, no error counted
// for more than `cap`, pixels. A point that no pair puts in front of both
// cameras goes to the median depth along its first ray. `points` must ascend.
// All other points stay, and the median is of their depths. O(observations),
// with a large constant.
void PlacePointsRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& points, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate);

// The same for frames, by those of their points that `is_placed` marks: as the
// rotation is known, a frame's origin lies on a line through each of these
// points. A frame that sees no such point stays.
void PlaceFramesRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& frames,
                         const std::vector<char>& is_placed, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate);

// For every part its observations of the points that it observes at least
// twice.
std::vector<std::vector<int64_t>> SplitIntoParts(
    const KnownRotationProblem& problem, const std::vector<int32_t>& part_of);

// All points of a problem, for PlacePointsRobustly.
std::vector<int32_t> AllPoints(const KnownRotationProblem& problem);

// The direction in the world of the ray on which v = 0, of unit length, for
// observation i.
Eigen::Vector3d DirectionOf(const KnownRotationProblem& problem, int64_t i);

// Finds positions of all frames and points from rotations and raw tracks,
// whatever outliers there are. For each connected component,
//
//   1. parts that share few of their tracks with others (FindParts) are placed
//      apart, since a programme holds only the mean scale, and what is weakly
//      tied would shrink at no cost; of each part
//   2. the longest tracks are taken, enough to check every frame many times
//      over and to connect them all;
//   3. their slack programme is solved from nothing (conic/interior_point.h),
//      and again with weights by which large errors count less; where its
//      matrix would fill, of a core of frames, then the others ring by ring;
//   4. the other points go where most of their rays agree;
//   5. several parts move to minima of a robust sum of squares
//      (finish/least_squares.h) and are joined;
//   6. all move to such a minimum. Tracks that disagree hold nothing there, so
//      what the others do not tie is joined anew, and frames and points that
//      hardly agree are placed anew, while that makes more observations agree;
//   7. if parts are left that nothing ties, though enough tracks cross or most
//      errors are far above the bound, all is placed as one part, too. The
//      start is taken of which most errors are below the bound, then the one
//      with fewer such parts, then the one with which more observations agree.
//
// Errors above `level`, pixels, count as wrong there. Depths are positive but
// for those of outliers.
Estimate FindRobustStart(const KnownRotationProblem& problem, Norm norm,
                         double level, const Context& context);

// Places a part of a problem; `*estimate` is the part's.
using PlacePart =
    std::function<void(const KnownRotationProblem& part, const Context& context,
                       Estimate* estimate)>;

// Places parts (`part_of` each frame) one by one, or leaves each as it is, if
// `place` is empty; then joins them, each with its own place and scale, and
// places the points anew that frames of several parts see.
void PlaceParts(const KnownRotationProblem& problem,
                const std::vector<int32_t>& part_of, Norm norm, double level,
                const Context& context, const PlacePart& place,
                Estimate* estimate);

// MinimizeRobustly for a connected problem. As tracks that cost more than a
// bound hold nothing, frames may have run away from the others there, alone or
// in parts, and points: they are placed anew, as long as more observations
// agree then.
// Returns into how many parts the frames fall that what agrees ties; > 0.
int32_t MinimizeAndJoin(const KnownRotationProblem& problem, Norm norm,
                        double level, const Context& context,
                        Estimate* estimate);

// How many observations agree with another one of their tracks: their errors
// are at most `cap`, pixels. O(observations).
int64_t NumAgreeing(const KnownRotationProblem& problem,
                    const Estimate& estimate, Norm norm, double cap);

// The median error of an estimate, pixels; that of a point behind its camera is
// infinite. 0 without observations. O(observations).
double MedianError(const KnownRotationProblem& problem,
                   const Estimate& estimate, Norm norm);

}  // namespace krot::internal
