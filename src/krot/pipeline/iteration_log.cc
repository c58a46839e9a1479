#include "krot/pipeline/iteration_log.h"

namespace krot {

JointCallback LogIterations(const SolveModelOptions& options,
                            const Timer& timer, SolveSummary* summary) {
  return [&options, &timer, summary](int, const JointIteration& state) {
    summary->iterations.push_back(state);
    summary->iterations.back().seconds = timer.Seconds();
    if (!options.joint.callback) return;
    options.joint.callback(static_cast<int>(summary->iterations.size()),
                           summary->iterations.back());
  };
}

}  // namespace krot
