#include "tools/benchmark/rivals/gugat.h"

#include <algorithm>
#include <cmath>

#include "tools/benchmark/rivals/cone_program_solver.h"
#include "tools/benchmark/rivals/parametric_program.h"

namespace krot::internal {
namespace {

// The limit of steps. If rounding hides whether gamma can be reached, steps
// would alternate between two values for ever.
constexpr int kMaxSteps = 100;

template <typename Cone>
class Gugat : public SubproblemSolver {
 public:
  std::string Name() const override { return "Gugat"; }

  Eigen::Vector3d Minimize(const Subproblem& problem) override {
    Eigen::Vector3d x = problem.start;
    double upper = problem.Cost(x, Program::norm());
    double lower = 0;
    double gamma = upper;
    for (int step = 0;
         step < kMaxSteps && upper - lower > kRivalTolerance * upper; ++step) {
      program_.Set(problem, x, gamma, Program::Weights::kDepths);
      Eigen::Vector4d y = program_.StartAt(x, /*margin=*/0.1 * gamma);
      ConeProgramOptions options;
      options.gap = 0.1 * kRivalTolerance * gamma;
      const ConeProgramSummary summary =
          solver_.Minimize(&program_, options, &y);
      const Eigen::Vector3d x_next = y.template head<3>();
      const double cost = problem.Cost(x_next, Program::norm());
      if (cost < upper) {
        x = x_next;
        upper = cost;
      }
      if (summary.tau_bound > 0) lower = std::max(lower, gamma);
      double next = gamma + summary.tau / Slope(problem, x_next);
      if (!(lower < next && next < upper)) next = upper;
      if (std::abs(next - gamma) <= kRivalTolerance * gamma) break;
      gamma = next;
    }
    return x;
  }

 private:
  using Program = ParametricProgram<Cone>;

  // Minus the slope of F: sum_i lambda_i w_i, where lambda_i is the multiplier
  // of gamma w_i.
  double Slope(const Subproblem& problem, const Eigen::Vector3d& x) const {
    double slope = 0;
    for (size_t i = 0; i < problem.residuals.size(); ++i) {
      slope += Cone::Identity().dot(solver_.multipliers()[i]) *
               problem.residuals[i].Depth(x);
    }
    return slope;
  }

  Program program_;
  ConeProgramSolver<Program> solver_;
};

}  // namespace

std::unique_ptr<SubproblemSolver> MakeGugat(Norm norm) {
  if (norm.p == 2) return std::make_unique<Gugat<SecondOrderCone>>();
  return std::make_unique<Gugat<FourHalfLines>>();
}

}  // namespace krot::internal
