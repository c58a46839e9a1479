#include "tools/krot/solve_progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "krot/report/text_table.h"

namespace krot {
namespace {

std::string Pixels(double value) { return FormatNumber(value, 6) + " px"; }

// How far `value` has come on its way from 1 down to `goal`, in decades.
double LogFraction(double value, double goal) {
  if (!(goal > 0 && goal < 1)) return 0;
  return value <= goal ? 1.0 : std::log(value) / std::log(goal);
}

}  // namespace

SolveProgress::Style SolveProgress::StyleOfStderr() {
  return isatty(STDERR_FILENO) == 1 ? Style::kBar : Style::kLines;
}

SolveProgress::SolveProgress(const LogOptions& log, const Goals& goals,
                             Style style)
    : log_(log), goals_(goals), style_(style) {}

SolveProgress::Goals SolveProgress::GoalsOf(const SolveModelOptions& options) {
  Goals goals;
  goals.relative_gap = options.joint.relative_gap;
  const bool is_auto = EffectiveMethod(options) == SolveMethod::kAuto;
  goals.sweep_tolerance = is_auto ? options.leading_sweep_tolerance
                                  : options.res_int.sweep_tolerance;
  goals.max_sweeps =
      is_auto ? options.max_leading_sweeps : options.res_int.max_sweeps;
  return goals;
}

void SolveProgress::Follow(SolveModelOptions* options, Context* context) {
  options->res_int.callback = [this](int sweep, const Sweep& state) {
    Update(sweep, state);
  };
  options->joint.callback = [this](int iteration, const JointIteration& state) {
    Update(iteration, state);
  };
  options->finish.callback = [this](const BoundedIterate& state) {
    Update(state);
  };
  context->on_note = [this](const std::string& sentence) { Note(sentence); };
}

void SolveProgress::Note(const std::string& sentence) {
  Finish();
  LogLine(log_, 1, sentence);
}

void SolveProgress::Update(int sweep, const Sweep& state) {
  Enter(Stage::kSweeps);
  Show(SweepFraction(sweep, state.cost),
       "sweep " + std::to_string(sweep) + ": cost " + Pixels(state.cost) +
           ", " + FormatNumber(state.seconds, 2) + " s");
}

void SolveProgress::Update(int iteration, const JointIteration& state) {
  const std::string name = "iteration " + std::to_string(iteration) + ": ";
  const std::string seconds = ", " + FormatNumber(state.seconds, 2) + " s";
  if (state.target) {
    Enter(Stage::kStart);
    Show(0,
         name + "looking for a start below " + Pixels(*state.target) + seconds);
    return;
  }
  Enter(Stage::kIterations);
  const std::string bound =
      state.lower_bound ? Pixels(*state.lower_bound) : "not yet known";
  Show(IterationFraction(state),
       name + "cost " + Pixels(*state.cost) + ", proved bound " + bound +
           ", estimated gap " + Scientific(*state.gap) + seconds);
}

void SolveProgress::Update(const BoundedIterate& state) {
  Enter(Stage::kFinish);
  Show(LogFraction(std::min(state.gap, 1.0), goals_.finish_gap),
       "finish " + std::to_string(state.iteration) + ": sum of squares " +
           FormatNumber(2 * state.cost, 3) + " px^2, estimated gap " +
           Scientific(state.gap));
}

void SolveProgress::Finish() {
  if (line_is_open_) std::cerr << std::endl;
  line_is_open_ = false;
}

void SolveProgress::Enter(Stage stage) {
  if (stage == stage_) return;
  Finish();
  stage_ = stage;
  fraction_ = 0;
  last_cost_.reset();
}

void SolveProgress::Show(double fraction, const std::string& words) {
  if (style_ == Style::kLines) {
    LogLine(log_, 1, words);
    return;
  }
  LogToSink(words);
  if (log_.level < 1) return;
  constexpr int kBarWidth = 30;
  fraction_ = std::clamp(fraction, fraction_, 1.0);
  const int filled = static_cast<int>(std::lround(kBarWidth * fraction_));
  const std::string bar =
      std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  // Back to the margin; what is left of a longer line is erased.
  std::cerr << "\r[" + bar + "] " + words + "\033[K" << std::flush;
  line_is_open_ = true;
}

double SolveProgress::SweepFraction(int sweep, double cost) {
  double done = static_cast<double>(sweep) / std::max(1, goals_.max_sweeps);
  if (last_cost_.has_value() && *last_cost_ > 0) {
    const double gain = (*last_cost_ - cost) / *last_cost_;
    done = std::max(done, LogFraction(gain, goals_.sweep_tolerance));
  }
  last_cost_ = cost;
  return done;
}

double SolveProgress::IterationFraction(const JointIteration& state) const {
  const double cost = *state.cost;
  double gap = *state.gap;
  if (state.lower_bound && cost > 0) {
    gap = std::min(gap, (cost - *state.lower_bound) / cost);
  }
  return LogFraction(std::min(gap, 1.0), goals_.relative_gap);
}

}  // namespace krot
