#include "tools/krot/solve_progress.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

// Errors of exact models are near 0.
std::string ErrorText(double value) {
  return (value >= 0.01 ? FormatNumber(value, 4) : Scientific(value)) + " px";
}

// How far `value` has come on its way from 1 down to `goal`, in decades.
double LogFraction(double value, double goal) {
  if (!(goal > 0 && goal < 1)) return 0;
  return value <= goal ? 1.0 : std::log(value) / std::log(goal);
}

}  // namespace

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
    ShowProgress(log_, Describe(sweep, state));
  };
  options->joint.callback = [this](int iteration, const JointIteration& state) {
    ShowProgress(log_, Describe(iteration, state));
  };
  options->finish.callback = [this](const BoundedIterate& state) {
    ShowProgress(log_, Describe(state));
  };
  context->on_note = [this](const std::string& sentence) {
    LogLine(log_, 1, sentence);
  };
  context->on_stage = [this](const std::string& what, int64_t done,
                             int64_t of) {
    if (of == 0) return BeginPhase(log_, what);
    ShowProgress(
        log_,
        {what, what + ": " + std::to_string(done) + " of " + std::to_string(of),
         static_cast<double>(done) / static_cast<double>(of)});
  };
}

Progress SolveProgress::Describe(int sweep, const Sweep& state) {
  return {"sweeps",
          "sweep " + std::to_string(sweep) + ": cost " + ErrorText(state.cost) +
              ", " + FormatNumber(state.seconds, 2) + " s",
          SweepFraction(sweep, state.cost)};
}

Progress SolveProgress::Describe(int iteration, const JointIteration& state) {
  last_cost_.reset();
  const std::string name = "iteration " + std::to_string(iteration) + ": ";
  const std::string seconds = ", " + FormatNumber(state.seconds, 2) + " s";
  if (state.target) {
    return {"start",
            name + "looking for a start below " + ErrorText(*state.target) +
                seconds,
            std::nullopt};
  }
  return {"iterations",
          name + "cost " + ErrorText(*state.cost) +
              (state.lower_bound ? ", proved " + ErrorText(*state.lower_bound)
                                 : std::string()) +
              ", gap ~" + Scientific(*state.gap) + seconds,
          IterationFraction(state)};
}

Progress SolveProgress::Describe(const BoundedIterate& state) {
  last_cost_.reset();
  return {"finish",
          "finish " + std::to_string(state.iteration) + ": sum of squares " +
              FormatNumber(2 * state.cost, 3) + " px^2, gap ~" +
              Scientific(state.gap),
          LogFraction(std::min(state.gap, 1.0), goals_.finish_gap)};
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

}  // namespace krot::internal
