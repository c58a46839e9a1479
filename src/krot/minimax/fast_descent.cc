#include "krot/minimax/fast_descent.h"

#include <cmath>
#include <optional>

#include "krot/base/check.h"
#include "krot/minimax/descent_step.h"

namespace krot::internal {

void CheckOptions(const FastDescentOptions& options) {
  const auto check = [](bool ok, const char* name, double value,
                        const char* requirement) {
    CheckArgument(ok, name, value, requirement);
  };
  check(options.max_iterations >= 1, "max_iterations", options.max_iterations,
        ">= 1");
  check(options.stationarity_tolerance >= 0, "stationarity_tolerance",
        options.stationarity_tolerance, ">= 0");
  check(options.step_tolerance > 0, "step_tolerance", options.step_tolerance,
        "> 0");
  check(options.slope_probe > 0, "slope_probe", options.slope_probe, "> 0");
  check(options.active_tolerance >= 0 && options.active_tolerance < 1,
        "active_tolerance", options.active_tolerance, "in [0, 1)");
  check(options.max_step > 0, "max_step", options.max_step, "> 0");
}

FastDescent::FastDescent(const FastDescentOptions& options, Norm norm)
    : options_(options), norm_(norm) {
  CheckOptions(options);
  CheckAtLeast(1, norm.p, "norm.p");
}

DescentSummary FastDescent::Minimize(Eigen::Vector3d* x) {
  ActiveResiduals none;
  return Minimize(DescentGoal{}, &none, x);
}

DescentSummary FastDescent::Minimize(const DescentGoal& goal,
                                     ActiveResiduals* active,
                                     Eigen::Vector3d* x) {
  if (options_.settings == FastDescentSettings::kPaper) {
    return MinimizeAsInPaper(x);
  }
  return newton_.Minimize(&residuals_, norm_, options_.max_iterations, goal,
                          active, x);
}

// [Zhang18, Alg. 2]. The text has no test for a step that fails to lower the
// cost, which tolerances make possible: it ends the descent.
DescentSummary FastDescent::MinimizeAsInPaper(Eigen::Vector3d* x) {
  DescentSummary summary;
  summary.cost_initial = residuals_.Evaluate(*x, norm_);
  summary.cost = summary.cost_initial;
  if (!std::isfinite(summary.cost)) {
    summary.termination = DescentTermination::kBehind;
    return summary;
  }
  const StepSizeOptions step_options{options_.step_tolerance,
                                     options_.slope_probe, options_.max_step};
  summary.termination = DescentTermination::kMaxIterations;
  while (summary.iterations < options_.max_iterations) {
    FindDescentNormals(residuals_, *x, norm_, options_.active_tolerance,
                       &descent_normals_);
    const std::optional<Eigen::Vector3d> direction = FindDescentDirection(
        descent_normals_, options_.stationarity_tolerance, &pieces_);
    if (!direction) {
      summary.termination = DescentTermination::kStationary;
      break;
    }
    ++summary.iterations;
    const double step =
        FindStepSize(residuals_, *x, *direction, norm_, step_options, &line_);
    const Eigen::Vector3d x_next = *x + step * *direction;
    const double cost = residuals_.Evaluate(x_next, norm_);
    if (!(cost < summary.cost)) {
      residuals_.Evaluate(*x, norm_);
      summary.termination = DescentTermination::kNoDecrease;
      break;
    }
    *x = x_next;
    summary.cost = cost;
  }
  return summary;
}

}  // namespace krot::internal
