#pragma once

#include "krot/base/timer.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// For the stages of a solve that iterate: appends every iteration to
// `summary->iterations`, with the seconds of the solve's `timer`, and hands it
// on to `callback`, counted over all stages. Keeps references to the other two.
JointCallback LogIterations(const JointCallback& callback, const Timer& timer,
                            SolveSummary* summary);

}  // namespace krot::internal
