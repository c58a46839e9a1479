#pragma once

#include <cstdint>
#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The sub-problem of some of the observations: only the points, views and
// frames that they see, in the order that they have in the whole problem. Its
// optimal cost is at most that of the whole.
struct RestrictedProblem {
  KnownRotationProblem problem;
  // What each part is called in the whole problem.
  std::vector<int64_t> observation_of;
  std::vector<int32_t> point_of;
  std::vector<int32_t> view_of;
  std::vector<int32_t> frame_of;
};

// `observations` must ascend strictly and be indices of `problem` (throws
// std::invalid_argument). O(observations given + points + views + frames).
RestrictedProblem RestrictProblem(const KnownRotationProblem& problem,
                                  const std::vector<int64_t>& observations);

// The part of an estimate of the whole problem that the sub-problem sees.
Estimate RestrictEstimate(const RestrictedProblem& part, const Estimate& whole);

// Puts the sub-problem's estimate into its place in `whole`.
void ReplaceEstimate(const RestrictedProblem& part, const Estimate& estimate,
                     Estimate* whole);

// Splits `observations` (ascending) by connected component of the problem that
// they span; components in the order of their first frame.
std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem,
    const std::vector<int64_t>& observations);

// Drops, until none is left, every observation that alone holds a point or a
// frame: that point or frame can be moved until the residual is zero, so such
// an observation bounds nothing. Takes and returns ascending indices.
// O(observations given + points + frames).
std::vector<int64_t> PruneUnconstrained(
    const KnownRotationProblem& problem,
    const std::vector<int64_t>& observations);

}  // namespace krot
