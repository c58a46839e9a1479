#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

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

}  // namespace krot::internal
