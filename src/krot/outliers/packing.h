#pragma once

#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/model.h"
#include "krot/outliers/conflict.h"
#include "krot/outliers/removal.h"

namespace krot::internal {

// What is found of the conflicts that removed observations take part in.
struct ConflictPacking {
  std::vector<Conflict> conflicts;
  bool is_complete = true;  // false: it ended for want of work
};

// An endoscope's model needs 1,300, and most fewer than 300.
inline constexpr int64_t kMostWork = 1500;

// Disjoint conflicts, each of which charges one of the removed observations
// with what others it does not go together with, so that as many as possible
// have one of their own. For each, those that barely miss the bound first, as
// they have the least choice, it looks
//
//   in its image alone and one other of its track, with the companions that
//     others need least (two_view_conflicts.h),
//   in two others, then in all, among the observations there whose rays miss
//     each other by most (neighbourhood.h),
//   and at last among the removal's tight observations,
//
// first among those that are neither removed nor taken already, so that no
// other has to share the charge, then with the removed ones that found none.
// Small conflicts leave more to others.
//
// Those that are `found` already, without a common observation, stay, and come
// first.
//
// Where hardly anything can be decided, as with wrong rotations, it ends with
// the conflicts so far once it has taken `work_per_observation` (Work) for each
// observation of the problem.
ConflictPacking PackAgainstRemoval(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const Removal& removal, std::vector<Conflict> found, const Context& context,
    int64_t work_per_observation = kMostWork);

}  // namespace krot::internal
