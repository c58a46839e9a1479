#pragma once

#include <optional>
#include <string>

#include "krot/pipeline/solve_model.h"
#include "tools/krot/log.h"

namespace krot::internal {

// Tells the user on stderr that a solve is alive: what its sweeps, its joint
// iterations and those of the finish have reached (ShowProgress).
class SolveProgress {
 public:
  // What fills the bar of a stage, except for the way to a start, whose end is
  // not known: the gain of a sweep falling to the
  // tolerance or the sweeps' number rising to the maximum; the gap of the
  // iterations falling to the one asked for.
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

  // Sets the callbacks that tell of sweeps, iterations, stages and choices;
  // they keep a reference to this.
  void Follow(SolveModelOptions* options, Context* context);

  // What each callback tells.
  Progress Describe(int sweep, const Sweep& state);
  Progress Describe(int iteration,
                    const JointIteration& state);  // or to a start
  Progress Describe(const BoundedIterate& state);  // of the finish

 private:
  double SweepFraction(int sweep, double cost);
  double IterationFraction(const JointIteration& state) const;

  LogOptions log_;
  Goals goals_;
  std::optional<double> last_cost_;  // of a sweep
};

}  // namespace krot::internal
