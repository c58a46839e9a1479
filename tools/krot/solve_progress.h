#pragma once

#include <optional>
#include <string>

#include "krot/pipeline/solve_model.h"
#include "tools/krot/log.h"

namespace krot {

// Tells the user on stderr that a solve is alive: what every sweep and every
// joint iteration and every one of the finish has reached.
class SolveProgress {
 public:
  enum class Style {
    kBar,   // one line with a bar that rewrites itself
    kLines  // one line per sweep or iteration
  };
  // kBar where stderr is a terminal.
  static Style StyleOfStderr();

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

  SolveProgress(const LogOptions& log, const Goals& goals,
                Style style = StyleOfStderr());
  ~SolveProgress() { Finish(); }
  SolveProgress(const SolveProgress&) = delete;
  SolveProgress& operator=(const SolveProgress&) = delete;

  // Sets the callbacks that tell of sweeps, iterations and choices; they keep a
  // reference to this.
  void Follow(SolveModelOptions* options, Context* context);

  void Update(int sweep, const Sweep& state);
  void Update(int iteration, const JointIteration& state);  // or to a start
  void Update(const BoundedIterate& state);                 // of the finish

  // A sentence on a line of its own.
  void Note(const std::string& sentence);

  // Ends the line of the bar.
  void Finish();

 private:
  enum class Stage { kNone, kSweeps, kStart, kIterations, kFinish };

  // Begins a new line and an empty bar if `stage` is new.
  void Enter(Stage stage);
  void Show(double fraction, const std::string& words);
  double SweepFraction(int sweep, double cost);
  double IterationFraction(const JointIteration& state) const;

  LogOptions log_;
  Goals goals_;
  Style style_;
  Stage stage_ = Stage::kNone;
  bool line_is_open_ = false;
  std::optional<double> last_cost_;  // of a sweep
  double fraction_ = 0;              // of the bar; never falls within a stage
};

}  // namespace krot
