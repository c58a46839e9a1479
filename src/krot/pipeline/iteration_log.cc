#include "krot/pipeline/iteration_log.h"

namespace krot::internal {

JointCallback LogIterations(const JointCallback& callback, const Timer& timer,
                            SolveSummary* summary) {
  return [callback, &timer, summary](int, const JointIteration& state) {
    summary->iterations.push_back(state);
    summary->iterations.back().seconds = timer.Seconds();
    if (!callback) return;
    callback(static_cast<int>(summary->iterations.size()),
             summary->iterations.back());
  };
}

}  // namespace krot::internal
