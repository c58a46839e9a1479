#pragma once

#include <optional>

#include "krot/pipeline/solve_model.h"
#include "tools/krot/log.h"

namespace krot::internal {

// Shows the user on stderr that a solve is alive: what its sweeps, its joint
// iterations and those of the finish have reached (ShowProgress).
class SolveProgress {
 public:
  // When a stage's bar is full: when the gain of a sweep has fallen to the
  // tolerance or the number of sweeps has risen to the maximum; when the gap of
  // the iterations has fallen to the one asked for. The search for a start has
  // no bar, since its end is not known.
  struct Goals {
    double sweep_tolerance = 0;
    int max_sweeps = 0;
    double relative_gap = 0;
    double finish_gap = BoundedOptions().gap_tolerance;
  };
  static Goals GoalsOf(const SolveModelOptions& options);

  SolveProgress(const LogOptions& log, const Goals& goals)
      : log_(log), goals_(goals) {}
  ~SolveProgress() { EndProgress(); }
  SolveProgress(const SolveProgress&) = delete;
  SolveProgress& operator=(const SolveProgress&) = delete;

  // Sets the callbacks for sweeps, iterations, stages and notes; they keep a
  // reference to this.
  void Follow(SolveModelOptions* options, Context* context);

  // What is shown for each callback.
  Progress Describe(int sweep, const Sweep& state);
  Progress Describe(int iteration,
                    const JointIteration& state);  // or the search for a start
  Progress Describe(const BoundedIterate& state);  // of the finish

 private:
  double SweepFraction(int sweep, double cost);
  double IterationFraction(const JointIteration& state) const;

  LogOptions log_;
  Goals goals_;
  std::optional<double> last_cost_;  // of a sweep
};

}  // namespace krot::internal
